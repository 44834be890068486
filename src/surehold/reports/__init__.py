"""Pictures and pages of runs: they take data and start nothing."""

from surehold.extras import require

require("report", "surehold.reports")
