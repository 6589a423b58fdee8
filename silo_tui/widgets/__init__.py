"""What draws: tables, panes, plots, bars and lines to type in. Widgets read a session and post messages.

They know no screen, no command and no app, and ask nothing of a logger. Screens and `context` import this.
"""
