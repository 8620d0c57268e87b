"""Charts of recorded runs as SVG, and the report that puts them together.

>>> from cairn.charts import Comparison, Request, Result, energy_change
>>> from cairn.run import run
>>> results = [
...     Result(Request("stack", method, 300, "default"), run("stack", method, "default", frames=300))
...     for method in ("pj", "pjsoft")
... ]
>>> svg = energy_change(Comparison("stack", results, 300))
"""

from .error_time import error_against_time, pareto
from .frames import ENERGY_CHANGE, JOINT_ERROR, PENETRATION, constraint_error, energy_change
from .residual import residual_trace
from .result import Comparison, Measured, Request, Result
from .timing import PAPER_MS, time_split, timing_table

__all__ = [
    "ENERGY_CHANGE", "JOINT_ERROR", "PAPER_MS", "PENETRATION", "Comparison", "Measured", "Request", "Result",
    "constraint_error", "energy_change", "error_against_time", "pareto", "residual_trace", "time_split", "timing_table",
]  # fmt: skip
