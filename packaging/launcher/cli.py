"""The command line of `./talbot`."""

from __future__ import annotations

import sys

from launcher import hosts, native
from launcher.common import LauncherError, say


def command_blender(arguments: list[str]) -> int:
    which = None
    if arguments[:1] == ["--blender"]:
        if len(arguments) < 2:
            raise LauncherError("--blender needs a value")
        which, arguments = arguments[1], arguments[2:]
    hosts.become(hosts.find_host(which, native.prepare()), arguments)
    return 0


def main(arguments: list[str]) -> int:
    try:
        if arguments[:1] == ["blender"]:
            return command_blender(arguments[1:])
        raise LauncherError("no such command")
    except LauncherError as error:
        say(str(error))
        return 1
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
