"""`python -m distfsi`: the same as the console command `distfsi`."""

from distfsi.commands.line import command

if __name__ == "__main__":
    command()
