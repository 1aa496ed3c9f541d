"""The site in a worker process: read once for all that is asked of it."""

from __future__ import annotations

from pathlib import Path

from executor.errors import SiteError
from executor.plan_page.site_problems import describe_problem
from executor.plan_page.site_view import SiteView, understand_site
from executor.site.site_model import SiteModel

_known: dict[tuple[str, Path], SiteModel] = {}
"""The last one that could be used."""


def read_site_view(text: str, folder: Path) -> SiteView:
    """Return what the page shows of a site, and keep the site for what is asked next."""
    view, ground = understand_site(text, folder)
    _known.clear()
    if ground is not None:
        _known[text, folder] = ground
    return view


def read_site_model(text: str, folder: Path) -> SiteModel:
    """Return a site to plan for.

    Raises:
        SiteError: it cannot be used; the first of its problems.
    """
    if (text, folder) not in _known:
        view = read_site_view(text, folder)
        if (text, folder) not in _known:
            raise SiteError(describe_problem(view.problems[0]))
    return _known[text, folder]
