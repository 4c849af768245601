"""The report of an evaluation: figures, tables and one page, all out of ``results.csv``."""

from hmrf_icp.evaluate.report.runs import Success
from hmrf_icp.evaluate.report.write import ReportFiles, write_report

__all__ = ["ReportFiles", "Success", "write_report"]
