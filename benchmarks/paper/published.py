"""The figures that the paper itself published, and Table III.

Testouri, Elghazaly, Frank: FastCycle: A Message Sharing Framework for Modular Automated Driving Systems,
arXiv 2211.15495. Only what is known here for certain stands here."""

from __future__ import annotations

from markdown import NOT_THERE, table

PAPER = (
    "Testouri, Elghazaly, Frank: *FastCycle: A Message Sharing Framework for Modular Automated Driving "
    "Systems*, [arXiv:2211.15495](https://arxiv.org/abs/2211.15495)"
)
MACHINE = "Intel i7-8700T, Linux 5.4, in a Docker container, n = 5000, a message every 1 ms"
SIZES = ("32 KB", "128 KB", "512 KB", "1 MB", "4 MB")
FASTCYCLE = "FastCycle, as published"
LATENCY = {
    FASTCYCLE: ("159 ± 164", "91 ± 98", "218 ± 142", "205 ± 133", "289 ± 115"),
    "ROS 2, in one process, as published": ("146 ± 20", NOT_THERE, NOT_THERE, NOT_THERE, "796 ± 167"),
}
ROUND_TRIP = {FASTCYCLE: ("133 ± 134", NOT_THERE, NOT_THERE, NOT_THERE, "537 ± 78")}


def sd_us(figures: dict[str, tuple[str, ...]]) -> dict[str, float]:
    """The standard deviation of the published FastCycle by the name of the size, where there is one."""
    return {
        size: float(cell.split("±")[1])
        for size, cell in zip(SIZES, figures[FASTCYCLE], strict=True)
        if cell != NOT_THERE
    }


def published_table(figures: dict[str, tuple[str, ...]]) -> str:
    return table(["µs", *SIZES], [[name, *cells] for name, cells in figures.items()])


CTEST = "ctest --test-dir build/dev"

# Property, what holds, what shows it.
SHOWN = (
    ("modularity", "a component is a shared library, named in a JSON file; other projects build theirs against "
     "an installed FastCycle", f"`{CTEST} -R consumer`"),
    ("modularity", "every error of a configuration is named with its place before anything starts",
     f"`fastcycle check app.json`; `{CTEST} -R BrokenConfiguration`"),
    ("modularity", "a library that is missing, broken, or hangs while loading is named, and nothing starts",
     f"`{CTEST} -L libraries`"),
    ("performance", "latency, round trip and jitter beside the floors of the machine",
     "`./dev bench paper`; one mode: `fastcycle bench latency`"),
    ("performance", "no allocation for a publish after warm-up, at any size; every subscriber reads the very "
     "message that was written", f"`{CTEST} -R core.HotPath`"),
    ("security", "no socket, no named shared memory, no core dump; other processes of the same user cannot read "
     "the process", f"`{CTEST} -L security`"),
    ("security", "**not** against root, a hostile component, or, without the installation that SECURITY.md "
     "describes, whoever watches for the start", f"`{CTEST} -R security.Security.AnAttacker`"),
    ("reliability", "an exception stops or restarts its component, or ends the run in order; the others run on",
     f"`{CTEST} -R host.Faults`"),
    ("reliability", "published = delivered + dropped (by reason) + queued, for every subscription, also when a "
     "run is ended in the middle", f"`{CTEST} -R 'host.Application|broker.Broker'`"),
    ("reliability", "a simulated run gives the same result with any number of workers",
     f"`{CTEST} -R host.Simulation`"),
    ("reliability", "**not**: a component that crashes ends the process with all components; there is no standby "
     "and no redundancy yet", "SECURITY.md, “What is not protected”"),
)  # fmt: skip

# What the documentation of others says. Nothing of it was tried here.
SAYS = (
    ("modularity", "nodelets: shared libraries loaded into one manager process "
     "([nodelet](https://wiki.ros.org/nodelet))",
     "components: shared libraries, composed in one process or in several when deployed "
     "([composition](https://docs.ros.org/en/jazzy/Concepts/Intermediate/About-Composition.html))",
     "components, named in DAG files and started by launch files "
     "([Quick Start](https://github.com/ApolloAuto/apollo/blob/master/docs/04_CyberRT/CyberRT_Quick_Start.md))"),
    ("performance", "no copy between nodelets of one manager (nodelet)",
     "lower overhead in one process, without copies under conditions "
     "([intra-process](https://docs.ros.org/en/jazzy/Tutorials/Demos/Intra-Process-Communication.html))",
     "shared memory lowers the latency where it is enabled (its FAQ)"),
    ("security", "by default any host that reaches the master may publish, subscribe and set parameters "
     "([security](https://wiki.ros.org/Security))",
     "authentication, encryption and access control, where enabled "
     "([security](https://docs.ros.org/en/jazzy/Concepts/Intermediate/About-Security.html))",
     "nothing found"),
    ("reliability", "nodes in processes of their own, restarted by `respawn` "
     "([roslaunch](https://wiki.ros.org/roslaunch/XML/node))",
     "fault isolation between nodes in processes of their own (composition)",
     "nothing found"),
)  # fmt: skip


def shown_table() -> str:
    return table(["", "what holds", "shown by"], SHOWN, text_columns=3)


def says_table() -> str:
    return table(["", "ROS 1", "ROS 2", "Cyber RT"], SAYS, text_columns=4)
