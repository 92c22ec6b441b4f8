#!/usr/bin/env python3
"""Runs a peer for a measurement: alone on a loopback network, with the daemon that it needs.

    run_peer.py --build build/release --list
    run_peer.py --build build/release zeromq -- --variant inproc --mode rtt --size 32768

prints the output of the peer, one line of JSON, and returns its exit code. As root, the peer and its
daemon get a separate network with a loopback only; without root they use the present network.

Other programs import PeerSession, which keeps network and daemons for a series of runs:

    with PeerSession("build/release") as session:
        row = session.run("ros1", variant="inter", mode="latency", size=32768, count=5000,
                          interval_us=1000, round=1)
"""

import argparse
import ctypes
import fcntl
import json
import os
import pathlib
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time

CLONE_NEWNET = 0x40000000
PR_SET_PDEATHSIG = 1
HERE = pathlib.Path(__file__).resolve().parent
LIBC = ctypes.CDLL(None, use_errno=True)


class PeerError(RuntimeError):
    """A peer or its daemon did not do what it should; the text says what."""


def fail_errno(what):
    raise PeerError(f"{what}: {os.strerror(ctypes.get_errno())}")


def bring_loopback_up():
    """`ip link set lo up`."""
    SIOCGIFFLAGS, SIOCSIFFLAGS, IFF_UP = 0x8913, 0x8914, 1
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        request = struct.pack("16sh22x", b"lo", 0)
        flags = struct.unpack("16sh22x", fcntl.ioctl(any_socket, SIOCGIFFLAGS, request))[1]
        fcntl.ioctl(any_socket, SIOCSIFFLAGS, struct.pack("16sh22x", b"lo", flags | IFF_UP))


class Network:
    """A network namespace with a loopback only, for root; else the one that is there."""

    def __init__(self):
        self.file = None
        if os.geteuid() == 0:
            self.file = self._make()

    @staticmethod
    def _make():
        """Opens the namespace of a child that only makes it; the open file keeps it alive."""
        child_says, says = os.pipe()
        release_read, release_write = os.pipe()
        child = os.fork()
        if child == 0:
            made = b"n"
            try:
                os.close(release_write)
                if LIBC.unshare(CLONE_NEWNET) == 0:
                    bring_loopback_up()
                    made = b"y"
            finally:
                os.write(says, made)
                os.read(release_read, 1)   # Ends when the parent closes its end.
                os._exit(0)
        try:
            os.close(says)
            if os.read(child_says, 1) == b"y":
                return os.open(f"/proc/{child}/ns/net", os.O_RDONLY | os.O_CLOEXEC)
            print("run_peer: no network of its own here; using the one that is there", file=sys.stderr)
            return None
        finally:
            for descriptor in (child_says, release_write, release_read):
                os.close(descriptor)
            os.waitpid(child, 0)

    def enter(self):
        """Called in a child, between fork and exec. The child will not outlive its parent."""
        LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if self.file is not None and LIBC.setns(self.file, CLONE_NEWNET) != 0:
            fail_errno("setns")

    def close(self):
        if self.file is not None:
            os.close(self.file)
            self.file = None


class Daemon:
    """A program that runs beside the peers, until stop()."""

    def __init__(self, name, command, environment, network, is_ready, seconds=20):
        self.name = name
        self.log = tempfile.TemporaryFile()
        try:
            self.process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=self.log, stderr=subprocess.STDOUT,
                env=environment, preexec_fn=network.enter, start_new_session=True)
        except OSError as error:
            raise PeerError(f"{name} does not start: {error}") from error
        deadline = time.monotonic() + seconds
        while not is_ready(self):
            if self.process.poll() is not None:
                raise PeerError(f"{name} ended before it was ready:\n{self.output()}")
            if time.monotonic() > deadline:
                self.stop()
                raise PeerError(f"{name} was not ready after {seconds} s:\n{self.output()}")
            time.sleep(0.05)

    def output(self):
        return os.pread(self.log.fileno(), 65536, 0).decode(errors="replace")

    def stop(self):
        stop_process(self.process)


def stop_process(process):
    """Asks it to end, then ends it; by its own id only."""
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def start_rosmaster(session):
    port = free_port()
    session.environment.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1",
                               ROS_LOG_DIR=session.folder)
    knock = ("import socket, sys\n"
             f"sys.exit(socket.socket().connect_ex(('127.0.0.1', {port})) != 0)")

    def is_ready(_daemon):
        return subprocess.run([sys.executable, "-c", knock],
                              preexec_fn=session.network.enter).returncode == 0

    return Daemon("rosmaster", ["rosmaster", "--core", "-p", str(port)], session.environment,
                  session.network, is_ready)


def start_roudi(session):
    return Daemon("iox-roudi", ["iox-roudi", "-c", str(HERE / "iceoryx" / "roudi.toml")],
                  session.environment, session.network,
                  lambda daemon: "RouDi is ready for clients" in daemon.output())


DAEMONS = {"rosmaster": start_rosmaster, "roudi": start_roudi}


class PeerSession:
    """Network and daemons for a series of runs. Use it in a `with` statement.

    build_dir is the folder of a preset, which has `peers/`. A daemon starts with the first run that
    needs it and stays until the end. All calls come from one thread, which lives as long as that: what
    it starts is killed when it ends.
    """

    def __init__(self, build_dir):
        self.programs = pathlib.Path(build_dir).resolve() / "peers"
        self.network = None
        self.daemons = {}
        self.environment = dict(os.environ)
        self._listed = {}
        self.folder = None
        self._temporary = None

    def __enter__(self):
        self._temporary = tempfile.TemporaryDirectory(prefix="fastcycle-peers-")
        self.folder = self._temporary.name
        self.network = Network()
        return self

    def __exit__(self, *_exception):
        for daemon in self.daemons.values():
            daemon.stop()
        self.daemons.clear()
        self.network.close()
        self._temporary.cleanup()

    def available(self):
        """(peer, variant, info) of all that are built; info is the object of `--list`."""
        peers = sorted(program.name.removeprefix("peer_") for program in self.programs.glob("peer_*"))
        return [(peer, info["variant"], info) for peer in peers for info in self._list(peer)]

    def info(self, peer, variant=None):
        """The object of `--list` of one variant, by default the first."""
        for info in self._list(peer):
            if variant in (None, info["variant"]):
                return info
        raise PeerError(f"peer {peer} has no variant '{variant}'")

    def run(self, peer, variant=None, mode="latency", timeout=None, **options):
        """One run, as a dictionary. Options are those of the command line: size, count, warmup,
        interval_us, round; those that are None are left to the program."""
        arguments = ["--mode", mode]
        for name, value in {"variant": variant, **options}.items():
            if value is not None:
                arguments += ["--" + name.replace("_", "-"), str(value)]
        status, output, errors = self.run_program(peer, arguments, timeout, variant)
        if status != 0:
            raise PeerError(f"peer_{peer} {' '.join(arguments)}: exit {status}: {errors.strip()}")
        return json.loads(output.splitlines()[-1])

    def run_program(self, peer, arguments, timeout=None, variant=None):
        """(exit status, standard output, standard error). Without a timeout it may take 10 minutes."""
        self._start_daemon(self.info(peer, variant)["daemon"])
        process = None
        try:
            process = subprocess.Popen(
                [self.programs / f"peer_{peer}", *arguments], stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=self.environment,
                preexec_fn=self.network.enter, cwd=self.folder)
            output, errors = process.communicate(timeout=timeout or 600)
        except subprocess.TimeoutExpired as error:
            raise PeerError(f"peer_{peer} {' '.join(arguments)}: not done in time") from error
        finally:
            if process:
                stop_process(process)
        return process.returncode, output, errors

    def _list(self, peer):
        """The objects of `--list` of one peer."""
        if peer not in self._listed:
            program = self.programs / f"peer_{peer}"
            if not program.is_file():
                raise PeerError(f"peer {peer} is not built in {self.programs}")
            listed = subprocess.run([program, "--list"], capture_output=True, text=True, timeout=30)
            if listed.returncode != 0:
                raise PeerError(f"{program} --list failed: {listed.stderr.strip()}")
            self._listed[peer] = [json.loads(line) for line in listed.stdout.splitlines()]
        return self._listed[peer]

    def _start_daemon(self, name):
        if name and name not in self.daemons:
            self.daemons[name] = DAEMONS[name](self)


def variant_in(arguments):
    """What `--variant V` or `--variant=V` names."""
    for i, argument in enumerate(arguments):
        if argument == "--variant" and i + 1 < len(arguments):
            return arguments[i + 1]
        if argument.startswith("--variant="):
            return argument.partition("=")[2]
    return None


def main():
    parser = argparse.ArgumentParser(description="Runs a peer with its own network and daemon.")
    parser.add_argument("--build", required=True, help="folder of a preset, such as build/release")
    parser.add_argument("--list", action="store_true", help="list the peers that are built")
    parser.add_argument("--timeout", type=float, help="time limit for the peer, in seconds")
    parser.add_argument("peer", nargs="?")
    parser.add_argument("arguments", nargs="*", help="options of the peer, after --")
    options = parser.parse_args()
    # Ctrl-C and a timeout around us end as an exception, so that all that was started is stopped.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    try:
        with PeerSession(options.build) as session:
            if options.list or options.peer is None:
                for _peer, _variant, info in session.available():
                    print(json.dumps(info))
                return 0
            status, output, errors = session.run_program(
                options.peer, options.arguments, options.timeout, variant_in(options.arguments))
            sys.stdout.write(output)
            sys.stderr.write(errors)
            return status
    except PeerError as error:
        print(f"run_peer: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())
