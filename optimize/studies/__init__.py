"""Studies: results of comparisons and sweeps in one place, which several processes write.

    from optimize.studies import open_store

    store = open_store("runs/studies.sqlite")    # or "postgresql://user@host/studies"
    study = store.begin("friction", "sweep", {"evaluations": 5000})
    study.add(run_task(task))                    # on the disk when it returns
    study.done()                                 # by key: these tasks need not run again

A store is an SQLite file, or a PostgreSQL database (extra ``postgres``) where machines share it.
``models`` has its tables, ``database`` the sessions and what goes wrong in them, ``store`` studies
by name, ``export`` what other programs read.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from optimize.studies.store import Store, Study

__all__ = ["DEFAULT_STORE", "Store", "Study", "open_store"]

DEFAULT_STORE = "runs/studies.sqlite"


def open_store(where: str | Path = DEFAULT_STORE, *, create: bool = True) -> Store:
    """Open a store of studies.

    Parameters
    ----------
    where
        A file, or an SQLAlchemy URL (``sqlite:///…``, ``postgresql://…``).
    create
        Whether to begin an empty store where there is none.

    Returns
    -------
    Store
        It holds no connection: threads may use it, and processes that are forked.

    Raises
    ------
    ValueError
        For a file that is damaged or no store, a store that a newer version of this program has
        written, a place that cannot be written, a server that does not answer. Nothing has changed
        then.
    ImportError
        Where the extra ``postgres`` is missing.
    """
    from optimize.studies.database import connect
    from optimize.studies.store import Store

    return Store(connect(where, create=create))


__getattr__, __dir__, _ = lazy_loader.attach(__name__, submod_attrs={"store": ["Store", "Study"]})
