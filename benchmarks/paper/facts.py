"""Facts about the machine, read by code: nothing of the report's head is typed by hand."""

from __future__ import annotations

import os
import pathlib
import re
import shutil
import subprocess
import sys
import time

NOT_INSTALLED = "not installed"
TRY_FIFO = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))"


def output(*command: str, timeout_s: float = 20) -> str:
    """What a command prints, or nothing if it is not there or fails."""
    if not shutil.which(command[0]):
        return ""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=timeout_s, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def text_of(path: str) -> str:
    try:
        return pathlib.Path(path).read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""


def load_average() -> list[float]:
    return list(os.getloadavg())


def steal_s() -> float:
    """Seconds that the hypervisor has kept the CPUs from this machine since it began, all CPUs together."""
    fields = text_of("/proc/stat").split("\n", 1)[0].split()
    return int(fields[8]) / os.sysconf("SC_CLK_TCK") if len(fields) > 8 else 0.0


def _cpu() -> str:
    found = re.search(r"^model name\s*: (.*)$", text_of("/proc/cpuinfo"), re.M)
    return found.group(1) if found else os.uname().machine


def _memory() -> str:
    found = re.search(r"^MemTotal:\s*(\d+) kB", text_of("/proc/meminfo"), re.M)
    return f"{int(found.group(1)) / 2**20:.1f} GiB" if found else "unknown"


def _virtualization() -> str:
    named = output("systemd-detect-virt", "--vm")
    if named or re.search(r"^flags\s*:.*\bhypervisor\b", text_of("/proc/cpuinfo"), re.M):
        return f"virtual machine ({named})" if named else "virtual machine"
    return "none seen"


def _may_use_fifo() -> bool:
    tried = subprocess.run([sys.executable, "-c", TRY_FIFO], capture_output=True, timeout=20, check=False)
    return tried.returncode == 0


def _system() -> str:
    found = re.search(r'^PRETTY_NAME="?(.*?)"?$', text_of("/etc/os-release"), re.M)
    return found.group(1) if found else "unknown"


def machine() -> dict[str, str]:
    """What a reader needs to know of the machine, by name."""
    cpu = "/sys/devices/system/cpu"
    return {
        "CPU": _cpu(),
        "cores": f"{os.cpu_count()} seen, {len(os.sched_getaffinity(0))} usable",
        "CPUs on the core of CPU 0": text_of(f"{cpu}/cpu0/topology/thread_siblings_list") or "unknown",
        "memory": _memory(),
        "virtualization": _virtualization(),
        "system": _system(),
        "kernel": f"{os.uname().sysname} {os.uname().release}",
        "kernel's preemption": re.sub(r".*?(PREEMPT\w*).*", r"\1", os.uname().version),
        "clock source": text_of("/sys/devices/system/clocksource/clocksource0/current_clocksource") or "unknown",
        "frequency governor": text_of(f"{cpu}/cpu0/cpufreq/scaling_governor") or "none shown to this machine",
        "idle driver": text_of(f"{cpu}/cpuidle/current_driver") or "none shown to this machine",
        "rights": "SCHED_FIFO is granted, and not used here" if _may_use_fifo() else "no SCHED_FIFO",
    }


def build(folder: pathlib.Path, root: pathlib.Path) -> dict[str, str]:
    """How what is measured was built."""
    cache = text_of(str(folder / "CMakeCache.txt"))

    def cached(name: str) -> str:
        found = re.search(rf"^{name}:\w+=(.*)$", cache, re.M)
        return found.group(1) if found else ""

    kind = cached("CMAKE_BUILD_TYPE")
    compiler = output(cached("CMAKE_CXX_COMPILER") or "c++", "--version").split("\n")[0]
    flags = f"{cached('CMAKE_CXX_FLAGS')} {cached(f'CMAKE_CXX_FLAGS_{kind.upper()}')}".strip()
    lto = ", link-time optimization of the library" if cached("FASTCYCLE_LTO") == "ON" else ""
    return {
        "FastCycle": revision(root),
        "compiler": compiler or "unknown",
        "build": f"{kind or 'unknown'}: {flags}{lto}",
    }


def revision(root: pathlib.Path) -> str:
    name = output("git", "-C", str(root), "rev-parse", "--short=12", "HEAD") or "unknown revision"
    changed = output("git", "-C", str(root), "status", "--porcelain", "--untracked-files=no", "--",
                     "src", "include", "tools", "messages", "cmake", "benchmarks/measure",
                     "benchmarks/components", "benchmarks/peers")  # fmt: skip
    return name + (" with changes that are not committed" if changed else "")


def packages(file: pathlib.Path) -> dict[str, str]:
    """The peers' packages, and the versions that are installed."""
    installed = {}
    for name in peers_of_packages(file):
        installed[name] = output("dpkg-query", "-W", "-f", "${Version}", name) or NOT_INSTALLED
    return installed


def peers_of_packages(file: pathlib.Path) -> dict[str, str]:
    """Package → the peer that needs it, from lines "package peer"; what follows # is a comment."""
    lines = (line.split("#")[0].split() for line in text_of(str(file)).splitlines())
    return {words[0]: words[1] if len(words) > 1 else words[0] for words in lines if words}


def now() -> str:
    return time.strftime("%Y-%m-%d %H:%M", time.gmtime()) + " UTC"
