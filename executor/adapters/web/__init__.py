"""The page to fly by: a small server in a thread of its own, and the files that a browser is given."""

from executor.adapters.web.page_server import WebSettings
from executor.adapters.web.server import WebServer

__all__ = ["WebServer", "WebSettings"]
