#!/usr/bin/env python3
"""Creates the pictures of docs/pictures that show commands with a running application: the drive of ads/applications/rav4,
live. `./dev pictures` builds the programs and calls it; it takes a minute.

  live_pictures.py [build/release]
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import time

from terminal_picture import LONGEST_S, SHELL, Terminal, picture_of

ROOT = pathlib.Path(__file__).resolve().parent.parent
PICTURES = ROOT / "docs/pictures"
APPLICATION = ["ads/applications/rav4/rav4.json", "--overlay", "ads/applications/rav4/tunnel.json"]
COLUMNS, ROWS = 120, 60  # The rows are more than any picture has.


def save(name, text, columns, title=""):
    (PICTURES / name).write_text(picture_of(text, columns, 0, title), encoding="utf-8")
    print(f"docs/pictures/{name}")


def shown(commands, environment):
    """What a terminal shows of the commands; a number among them is a pause."""
    with Terminal(SHELL, COLUMNS, ROWS, environment) as terminal:
        for command in commands:
            terminal.type(command) if isinstance(command, str) else terminal.pause(command)
        return terminal.text()


def top(environment):
    with Terminal(["fastcycle", "top"], 80, 24, environment) as terminal:
        def take(name, key, wanted):
            terminal.key(key)
            terminal.wait(wanted)
            terminal.pause(2)  # Until there are rates.
            save(name, terminal.text(), 80, "fastcycle top")

        take("top.svg", "1", "CPU%")
        take("top_topics.svg", "2", "RATE")
        terminal.key("Down")
        take("top_topic.svg", "Enter", "subscriber")


def tunnel(environment):
    """A log in one terminal, the commands that it lists in another, below each other."""
    with Terminal(["fastcycle", "log"], COLUMNS, ROWS, environment) as log:
        log.pause(1)
        said = shown(["fastcycle param get supervision.gnss.age_max_s", "fastcycle mode", "fastcycle mode tunnel", 2,
                      "fastcycle chain gnss_to_pose"], environment)
        log.wait("degraded")
        dim, green, plain = "\x1b[2m", "\x1b[32m", "\x1b[m"
        save("live_tunnel.svg", f"{dim}In one terminal:{plain}\n\n{green}${plain} fastcycle log\n{log.text()}\n\n"
             f"{dim}In another:{plain}\n\n{said}", COLUMNS)


def take_all(environment):
    save("live.svg", shown(["fastcycle list", "fastcycle component list", "fastcycle chain wheels_to_pose"],
                           environment), COLUMNS)
    save("live_topic.svg", shown(["fastcycle topic info localization/pose", "fastcycle topic echo gnss/fix --once",
                                  "fastcycle topic hz localization/pose --count 2",
                                  "fastcycle topic delay localization/pose --count 1",
                                  "fastcycle topic bw can/frames --count 1"], environment), COLUMNS)
    top(environment)
    subprocess.run(["fastcycle", "graph", "--live", "-o", "docs/pictures/live_graph.svg"], env=environment, check=True)
    tunnel(environment)


def main():
    build = (ROOT / (sys.argv[1] if len(sys.argv) > 1 else "build/release")).resolve()
    with tempfile.TemporaryDirectory() as folder:
        environment = dict(os.environ, XDG_RUNTIME_DIR=folder, PATH=f"{build}/bin:{os.environ['PATH']}")
        os.chdir(ROOT)
        run = subprocess.Popen(["fastcycle", "run", *APPLICATION, "--set", f"picture.file={folder}/drive.svg", "--quiet"],
                               env=environment, stderr=subprocess.DEVNULL)
        try:
            end = time.monotonic() + LONGEST_S
            while subprocess.run(["fastcycle", "mode"], env=environment, capture_output=True).returncode != 0:
                if run.poll() is not None or time.monotonic() > end:
                    sys.exit("live_pictures.py: the application does not run")
                time.sleep(0.1)
            time.sleep(5)
            take_all(environment)
            if run.poll() is not None:
                sys.exit("live_pictures.py: the application ended before the last picture")
        finally:
            run.terminate()
            run.wait()


if __name__ == "__main__":
    main()
