"""Saved logs: open one, take its signals, compute, compare, draw and report.

Knows files and recordings; knows no running logger, no Zenoh and no screen. Used by `silo/cli/`, `silo_tui/` and the
programs of users, never by what logs.
"""
