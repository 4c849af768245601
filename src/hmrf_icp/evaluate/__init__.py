"""The paper's experiment on any sequence: who registers what, from how far, and how well."""

from hmrf_icp.evaluate.configuration import Configuration
from hmrf_icp.evaluate.evaluation import Evaluation, evaluate
from hmrf_icp.evaluate.methods import Estimate, NamedMethod
from hmrf_icp.evaluate.protocol import Start

__all__ = ["Configuration", "Estimate", "Evaluation", "NamedMethod", "Start", "evaluate"]
