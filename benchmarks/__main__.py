"""The short benchmarks, one after the other; the long ones (`best_observed`, `robust_recommendation`) run by name."""

import sys

from benchmarks import grasp_trial, suggestion_time, wrench_quality

for title, run in (
    ("Seconds per suggestion", suggestion_time.main),
    ("One grasp trial", lambda: grasp_trial.main(["mug", "bottle"])),
    ("Quality of a set of contacts", wrench_quality.main),
):
    print(f"\n{title}\n{'=' * len(title)}")
    sys.stdout.flush()
    run()
