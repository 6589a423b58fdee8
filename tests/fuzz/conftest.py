"""Fuzzers are slow."""


def pytest_configure(config):
    config.addinivalue_line("markers", "slow: takes seconds, or starts processes")
