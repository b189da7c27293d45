"""A replay as one page: self-contained HTML that opens offline, on a laptop or a phone."""

from service.report.page import page

__all__ = ["page"]
