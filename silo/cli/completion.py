"""`silo completion`: what a shell needs to complete commands, loggers and elements."""

import click
from click.shell_completion import get_completion_class

_SHELLS = ("bash", "zsh", "fish")


@click.command()
@click.argument("shell", type=click.Choice(_SHELLS))
def completion(shell: str) -> None:
    """Print completion code for a shell: commands, options, loggers and elements.

    \b
    bash   add to ~/.bashrc:   eval "$(silo completion bash)"
    zsh    add to ~/.zshrc:    eval "$(silo completion zsh)"
    fish   run once:           silo completion fish > ~/.config/fish/completions/silo.fish
    """
    from silo.cli.group import cli

    maker = get_completion_class(shell)
    if maker is None:
        raise click.ClickException(f"no completion for {shell} in this version of click")
    click.echo(maker(cli, {}, "silo", "_SILO_COMPLETE").source())
