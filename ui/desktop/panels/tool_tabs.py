"""The tab of the tool in force is in front, and a person who leaves the tab leaves the tool."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtWidgets import QTabWidget, QWidget

from palpate.ui.desktop.session.controller import Controller


class ToolTabs:
    """tools : tab -> the tools that belong to it; Look and Window belong to all of them."""

    def __init__(self, controller: Controller, tabs: QTabWidget, tools: Mapping[QWidget, tuple[str, ...]]) -> None:
        self._controller, self._tabs = controller, tabs
        self._owner = {tool: tab for tab, names in tools.items() for tool in names}
        tabs.currentChanged.connect(self._turned)

    def on_change(self, what: str) -> None:
        """Something has changed."""
        owner = self._owner.get(self._controller.display.tool)
        if what == "tools" and owner is not None and self._tabs.currentWidget() is not owner:
            self._tabs.setCurrentWidget(owner)

    def _turned(self, index: int) -> None:
        owner = self._owner.get(self._controller.display.tool)
        if owner is not None and self._tabs.widget(index) is not owner:
            self._controller.show(tool="look")
