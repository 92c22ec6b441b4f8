"""standby_kills.py FASTCYCLE APPLICATION PROCESSES TOPICS KILLS [SEED] [--stop]: an application live, processes of which (comma between them)
have standbys; whichever of the two does the work is killed, or stopped, KILLS times at random moments. An application that comes to its end is run
again.

What is judged is the log that the main process records: on TOPICS (comma between them) no sequence is missing, none comes twice, and the
gap between two messages around a kill is shown beside the gaps of the time without kills. Of each kill: how long until the first message
that was published after the other process had taken over, as the log of the run says.
"""
import argparse
import bisect
import json
import os
import pathlib
import random
import re
import signal
import statistics
import subprocess
import tempfile
import time

from kills import children_of, fail, wait_for


def messages_of(program, log, topic):
    """Of each message of the topic in the log: its sequence, and when it was published, s since 1970."""
    shown = subprocess.run([program, "echo", str(log), topic, "--json"], capture_output=True, text=True, check=True)
    said = [json.loads(line) for line in shown.stdout.splitlines()]
    return [(int(one["sequence"]), one["publish_time_ns"] * 1e-9) for one in said]


def start_of(program, log):
    """When the timers of the run began, s since 1970: what the stamps of its log lines count from."""
    shown = subprocess.run([program, "info", str(log)], capture_output=True, text=True, check=True)
    return int(re.search(r"^ *timers_ns +(\d+)$", shown.stdout, re.MULTILINE)[1]) * 1e-9


NEAR_S = 0.002  # The gap of a kill begins so long after it at most.


class Over(Exception):
    """The application has come to its end."""


class Drive:
    """One run of the application, with kills."""

    def __init__(self, options, program, folder):
        self.options = options
        self.moments = []  # When who was killed.
        self.out = folder / "out.txt"
        self.log = folder / "log.mcap"
        words = [word for overlay in options.overlay for word in ("--overlay", os.path.abspath(overlay))]
        record = ["--set", f"{options.recorder}.file={self.log}"] if options.recorder else ["--record", str(self.log)]
        with self.out.open("w") as errors:
            self.run = subprocess.Popen([program, "run", os.path.abspath(options.application), *words, "--quiet", *record],
                                        stdout=errors, stderr=subprocess.STDOUT, cwd=folder)
        self.active = {name: name for name in options.processes}
        self.is_awaiting = False  # Whether the process killed last has not yet been replaced.

    def run_of(self, name):
        """The last run in which the process has followed the other one; 0: none."""
        runs = re.findall(rf'"{re.escape(name)}" is on standby, in its run (\d+)', self.out.read_text())
        return int(runs[-1]) if runs else 0

    def await_standby(self, name, run):
        """Waits until the process follows the other one, in this run or a later one: one that cannot follow is made anew."""
        def has_run():
            if self.run_of(name) >= run:
                return True
            if self.run.poll() is not None:
                raise Over
            return None
        wait_for(f"run {run} of the standby {name}", has_run, 120, self.what_happened)

    def what_happened(self):
        """The end of the run's output and its processes, for a failure."""
        children = subprocess.run(["ps", "-o", "pid,stat,wchan:30,etimes,comm", "--ppid", str(self.run.pid)], capture_output=True, text=True)
        return f"; the run ends with:\n{self.out.read_text()[-4000:]}\n{children.stdout}"

    def pid_of(self, name):
        def there():
            if self.run.poll() is not None:
                raise Over
            is_long = len(name) > 15 and name.endswith(".standby")
            return children_of(self.run.pid).get(name[:7] + ".standby" if is_long else name[:15])
        return wait_for(name, there, 30, self.what_happened)

    def begin(self):
        for name in self.options.processes:
            self.await_standby(name + ".standby", 1)
        time.sleep(0.5)

    def kill_one(self, rng):
        time.sleep(rng.uniform(0, 2 * self.options.pause))
        name = rng.choice(self.options.processes)
        active = self.active[name]
        process = self.pid_of(active)
        run = max(1, self.run_of(active))
        moment = time.time()
        os.kill(process, signal.SIGSTOP if self.options.stop else signal.SIGKILL)
        self.is_awaiting = True
        time.sleep(0.05)  # Leaves the CPUs to the takeover.
        self.await_standby(active, run + 1)
        self.is_awaiting = False
        self.moments.append(moment)  # Only now: before its end nothing is judged.
        self.active[name] = name if active != name else name + ".standby"

    def takeovers(self, program):
        """When a standby took over, s since 1970."""
        lines = re.findall(r'^(\d+\.\d+) warning fastcycle: process "[^"]*" has taken over', self.out.read_text(), re.MULTILINE)
        begin = start_of(program, self.log)
        return [begin + float(stamp) for stamp in lines]

    def end(self):
        if self.run.poll() is None:
            self.run.send_signal(signal.SIGINT)
        return self.run.wait(60)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("application")
    parser.add_argument("processes", type=lambda text: text.split(","))
    parser.add_argument("topics", type=lambda text: text.split(","))
    parser.add_argument("kills", type=int)
    parser.add_argument("seed", type=int, nargs="?", default=1)
    parser.add_argument("--stop", action="store_true", help="SIGSTOP instead of SIGKILL")
    parser.add_argument("--pause", type=float, default=0.3, help="mean time between kills, in s")
    parser.add_argument("--recorder", help="the recording component, if the application has one")
    parser.add_argument("--overlay", action="append", default=[])
    options = parser.parse_args()
    rng = random.Random(options.seed)
    program = os.path.abspath(options.program)
    kills, runs = 0, 0
    found = {topic: {"missing": 0, "twice": 0, "messages": 0, "around": [], "others": [], "firsts": []} for topic in options.topics}
    while kills < options.kills:
        with tempfile.TemporaryDirectory() as name:
            drive = Drive(options, program, pathlib.Path(name))
            try:
                drive.begin()
                while kills + len(drive.moments) < options.kills:
                    drive.kill_one(rng)
                time.sleep(1)
            except Over:
                pass
            finally:
                code = drive.end()
            # A process killed while the application ends is not replaced, and the run says so with exit code 1.
            if code not in ([0, 1] if drive.is_awaiting else [0]) or not drive.moments:
                fail(f"the run ended with {code} after {len(drive.moments)} kills:\n{drive.out.read_text()}")
            kills += len(drive.moments)
            runs += 1
            for topic in options.topics:
                add(found[topic], messages_of(program, drive.log, topic), drive.moments, drive.takeovers(program))
    print(f"{kills} {'stops' if options.stop else 'kills'} in {runs} runs")
    for topic, its in found.items():
        show(topic, its)
    if any(its["missing"] or its["twice"] for its in found.values()):
        fail("messages are missing, or come twice")


def add(its, messages, moments, takeovers):
    sequences = [sequence for sequence, _ in messages]
    times = [at for _, at in messages]
    its["messages"] += len(messages)
    its["missing"] += sum(b - a - 1 for a, b in zip(sequences, sequences[1:]) if b > a + 1)
    its["twice"] += sum(1 for a, b in zip(sequences, sequences[1:]) if b <= a)
    # The killed process may publish until the signal reaches it.
    around = set()
    for moment in moments:
        near = [i for i in range(bisect.bisect_left(times, moment) - 1, bisect.bisect_left(times, moment + NEAR_S)) if 0 <= i < len(times) - 1]
        if near:
            around.add(max(near, key=lambda i: times[i + 1] - times[i]))
        done = next((at for at in takeovers if at >= moment), None)
        first = bisect.bisect_left(times, done) if done else len(times)
        if first < len(times):
            its["firsts"].append(times[first] - moment)
    for i, (a, b) in enumerate(zip(times, times[1:])):
        its["around" if i in around else "others"].append(b - a)


def show(topic, its):
    print(f"{topic}: {its['messages']} messages, {its['missing']} missing, {its['twice']} twice")
    for name, words in (("around", "gap around a kill"), ("others", "other gaps"), ("firsts", "from a kill to the first message after the takeover")):
        if its[name]:
            print(f"  {words}: {shown_times(its[name])}")


def shown_times(times):
    return f"p50 {1e3 * statistics.median(times):.3f} ms, max {1e3 * max(times):.3f} ms" if times else "none"


if __name__ == "__main__":
    main()
