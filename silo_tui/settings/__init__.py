"""The user's own settings, `~/.config/silo/tui.yaml`: what there is to set, reading, writing.

Reading never fails: what can't be taken is left out line by line and told. Nothing here knows the app or a screen.
"""
