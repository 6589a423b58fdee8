"""Foxglove, Lichtblick and PlotJuggler draw a logger live, over the Foxglove WebSocket protocol."""
