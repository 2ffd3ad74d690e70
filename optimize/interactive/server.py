"""Server: the page of a draft on this machine, in a browser or a notebook."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from domino_env.core.checks import require, require_choice, require_extra
from domino_env.physics.layout import Layout
from domino_env.scenes.io.reading import load_scene, scene_names
from domino_env.scenes.scene import Scene
from optimize.interactive.draft import Draft
from optimize.interactive.exchange import KEY, open_draft, read_link
from optimize.searching import compile_simulations

HOST = "localhost"
LIFETIME = 30_000  # [ms] of a tab without a connection, also of one that is not connected yet
HEIGHT = 1200  # [px] of the page in a notebook
TEMPLATE = Path(__file__).with_name("template.html")  # of the document that contains the page


class Studio:
    """A page on this machine on which a layout is designed; its tabs are independent.

    A notebook shows the page if the object is the last value of a cell.

    Parameters
    ----------
    draft
        The draft with which every tab begins.
    port
        Port on this machine; 0 for any free one.

    Attributes
    ----------
    url
        Address of the page; empty while it is not served.
    """

    def __init__(self, draft: Draft, port: int = 0) -> None:
        require("port", port, 0, 65535, whole=True)
        self.url, self._port, self._first = "", port, draft
        self._pages: list[Any] = []  # of all open tabs
        self._last: Any = None  # the page that was opened last

    @property
    def layout(self) -> Layout:
        """Layout of the tab that was opened last; before any, the first one."""
        return (self._last.draft if self._last else self._first).layout

    def serve(self, callback: Callable[[str], object], *, until_closed: bool = True) -> None:
        """Serve the page until Ctrl-C or, with `until_closed`, until the last tab is closed.

        Parameters
        ----------
        callback
            Function that is called with the address once the page can be opened.
        until_closed
            If True, the server also ends some seconds after the last tab is closed.

        Raises
        ------
        OSError
            If the port is in use; the message has it.
        """
        from panel.io.server import get_server

        asyncio.set_event_loop(asyncio.new_event_loop())  # only the main thread has one already
        try:
            server: Any = get_server(
                lambda: self._new_tab(server.io_loop.stop if until_closed else lambda: None),
                port=self._port, address="127.0.0.1", title="Domino studio", location=False,
                unused_session_lifetime_milliseconds=LIFETIME,
                check_unused_sessions_milliseconds=LIFETIME // 20,
            )  # fmt: skip
        except OSError as error:
            hint = "give another port, or 0 for any free one (--port)"
            raise OSError(f"port {self._port}: {error.strerror}: {hint}") from None
        # the compilation in a first search would block the page
        compile_simulations(self._first.scene, gradients=True)
        server.start()
        self.url = f"http://{HOST}:{server.port}/"
        callback(self.url)
        try:
            server.io_loop.start()
        finally:
            server.stop()
            server.io_loop.close()
            for page in self._pages:
                page.close()
            self.url = ""

    def _new_tab(self, after_last: Callable[[], None]) -> Any:
        """Return the page of a new tab, with the draft in its link or else the first one."""
        import panel as pn

        from optimize.interactive.page import Page

        draft, message, arguments = self._first, "", pn.state.session_args or {}
        try:
            if link := arguments.get(KEY):
                draft = read_link(link[0].decode())
            elif name := arguments.get("scene", [b""])[0].decode():
                require_choice("scene", name, scene_names())  # never a path
                draft = Draft.uniform(load_scene(name))
        except ValueError as error:
            message = str(error)
        document: Any = pn.state.curdoc
        page = Page(draft, document.add_next_tick_callback)
        page.notify(message, "error")

        def end(_: object) -> None:
            page.close()
            if page in self._pages:
                self._pages.remove(page)
                if not self._pages:
                    after_last()

        def begin() -> None:
            page.open()
            self._pages.append(page)
            self._last = page

        pn.state.onload(begin)  # not for a request without a tab
        pn.state.on_session_destroyed(end)
        template = pn.Template(TEMPLATE.read_text("utf-8"))
        template.add_panel("page", page.view)
        return template

    def _repr_html_(self) -> str:
        """Serve the page in a thread, and return a frame that shows it."""
        if not self.url:
            ready = threading.Event()

            def serve() -> None:
                try:
                    self.serve(lambda _: ready.set(), until_closed=False)
                finally:  # also if the port is in use
                    ready.set()

            threading.Thread(target=serve, daemon=True).start()
            ready.wait()
        return f'<iframe src="{self.url}" style="width:100%;height:{HEIGHT}px;border:0"></iframe>'


def studio(source: str | Path | Scene | Layout = "course", port: int = 0) -> Studio:
    """Design a layout by hand on a page of this machine: drag, improve, search, check, print.

    Parameters
    ----------
    source
        A scene or a layout, the name or path of one, a run folder, or a link of the page.
    port
        Port on this machine; 0 for any free one.

    Returns
    -------
    Studio
        Object that a notebook shows as the page; its `layout` is the one designed there.

    Raises
    ------
    ImportError
        If Panel is missing; the message has the command that installs it.
    ValueError
        If the scene or layout cannot be read, or if the scene has no free values.

    Examples
    --------
    >>> from optimize import studio
    >>> studio("sprint").layout.count
    40
    """
    require_extra("the studio", "studio", "panel")
    return Studio(open_draft(source), port)
