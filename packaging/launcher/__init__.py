"""What `./talbot` does, one module a command. Standard library only: this runs under the system's Python."""
