"""Commands that run a program beside: demo, host, viewers, routers, examples."""
