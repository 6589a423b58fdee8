"""Commands on loggers that run."""
