"""The site in the worker process, read once for all requests."""

from __future__ import annotations

from pathlib import Path

from executor.errors import SiteError
from executor.plan_page.site_files import stamp_files
from executor.plan_page.site_problems import check_text, describe_problem
from executor.plan_page.site_view import SiteView, understand_site
from executor.site.site_model import SiteModel

SiteKey = tuple[str, Path, tuple[object, ...]]
"""Text of the site file, its folder, and the times of the files that it names."""
_known: dict[SiteKey, SiteModel] = {}
"""The last usable site."""


def read_site_view(text: str, folder: Path) -> SiteView:
    """Return what the page shows of a site, and keep the site for what is asked next."""
    key = find_site_key(text, folder)
    view, ground = understand_site(text, folder)
    _known.clear()
    if ground is not None:
        _known[key] = ground
    return view


def find_site_key(text: str, folder: Path) -> SiteKey:
    """Return what is another one whenever the site may be."""
    return text, folder, tuple(stamp_files(check_text(text)[0], folder))


def read_site_model(text: str, folder: Path) -> SiteModel:
    """Return a site to plan for.

    Raises:
        SiteError: it cannot be used; the first of its problems.
    """
    key = find_site_key(text, folder)
    if key not in _known:
        view = read_site_view(text, folder)
        if key not in _known:
            raise SiteError(describe_problem(view.problems[0]))
    return _known[key]
