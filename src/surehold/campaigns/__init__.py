"""Many runs: plans, their execution by many workers, tables on disk, statistics, and the thesis' tables and figures.

plan, plan_file    what is run: problems x methods x seeds, in Python or YAML
methods, peers     our optimizer and other libraries' behind one interface
single_run, runner one run and all of them; a kill loses the runs in flight, the same call continues
table              the rows on disk
statistics, comparison, published, thesis   what the runs say, beside each other and beside the thesis
sections, costs, illustrations, report, reproduction   the page, the CSVs and the document made from them
"""

from surehold.extras import require

require("campaign", "surehold.campaigns")
