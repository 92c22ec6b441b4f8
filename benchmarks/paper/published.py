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


def by_size(figures: dict[str, tuple[str, ...]]) -> dict[str, dict[str, str]]:
    return {name: dict(zip(SIZES, cells, strict=True)) for name, cells in figures.items()}


def sd_us(figures: dict[str, tuple[str, ...]]) -> dict[str, float]:
    """The standard deviation of the published FastCycle by the name of the size, where there is one."""
    return {
        size: float(cell.split("±")[1])
        for size, cell in zip(SIZES, figures[FASTCYCLE], strict=True)
        if cell != NOT_THERE
    }


# Property, what shows it.
SHOWN = (
    ("modularity", "`-R consumer` builds a component against an installation; `-R BrokenConfiguration`, `-L libraries`: "
     "errors are reported before anything starts"),
    ("performance", "this report; `-R core.HotPath`: no allocation and no copy after warm-up"),
    ("security", "`-L security`; SECURITY.md says what is not protected"),
    ("reliability", "`-R host.Faults`: exceptions; `./dev soak processes`: crashes; `-R 'host.Application|broker.Broker'`: "
     "every loss is counted; `-R host.Simulation`: simulated runs repeat"),
)  # fmt: skip


def shown_table() -> str:
    return table(["property", "`ctest --test-dir build/dev`"], SHOWN, text_columns=2)
