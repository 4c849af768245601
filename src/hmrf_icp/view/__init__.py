"""A registration to look at: in the browser, as a page to send, as a recording of rerun."""

from hmrf_icp.figures.states import Recording
from hmrf_icp.view.page import write_html
from hmrf_icp.view.rerun import write_rrd
from hmrf_icp.view.server import Viewer
from hmrf_icp.view.show import show
from hmrf_icp.view.story import Story
from hmrf_icp.view.telling import story

__all__ = ["Recording", "Story", "Viewer", "show", "story", "write_html", "write_rrd"]
