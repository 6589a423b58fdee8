"""Opening the large plot of a monitor."""

from silo.core.quantities.writing import many
from silo_tui.screens.file_monitor import FileMonitorScreen
from silo_tui.screens.monitor import MonitorScreen


def open_large(monitor: MonitorScreen) -> None:
    """Show the chosen plot alone; say so where nothing of it can be drawn."""
    from silo_tui.screens.detail import DetailScreen
    from silo_tui.screens.file_detail import FileDetailScreen

    if not monitor.stack.plots:
        return
    on_file = isinstance(monitor, FileMonitorScreen)
    if not monitor.stack.for_detail()[0]:
        texts = f"{many(len(monitor.stack.plots), 'text')}: nothing to draw"
        monitor.say(texts if on_file else "nothing that is on to plot")
    elif isinstance(monitor, FileMonitorScreen):
        monitor.app.push_screen(FileDetailScreen(monitor))
    else:
        monitor.app.push_screen(DetailScreen(monitor))
