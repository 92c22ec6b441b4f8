"""same_drive.py FASTCYCLE ADS.json TIME [WORKERS ...]: a simulated drive of the ADS gives the same with all components
in one process and with each in its own, whatever the number of workers.

All messages of all topics are compared, byte by byte, with their sequence numbers and times; what FastCycle itself publishes is
not. The logs are read here, without FastCycle. Then `fastcycle verify` executes all activations of the isolated drive again.
"""
import collections
import hashlib
import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile

MAGIC = b"\x89MCAP0\r\n"
CHANNEL, MESSAGE, CHUNK = 0x04, 0x05, 0x06


def fail(text):
    sys.exit(f"same_drive: {text}")


def records(data):
    place = 0
    while place + 9 <= len(data):
        kind, size = data[place], struct.unpack_from("<Q", data, place + 1)[0]
        yield kind, memoryview(data)[place + 9 : place + 9 + size]
        place += 9 + size


def text_at(body, place):
    size = struct.unpack_from("<I", body, place)[0]
    return bytes(body[place + 4 : place + 4 + size]).decode(), place + 4 + size


def messages(log):
    """By topic: for each message its sequence, its times and a hash of its bytes, in the order of their times."""
    data = pathlib.Path(log).read_bytes()
    if not data.startswith(MAGIC) or not data.endswith(MAGIC):
        fail(f"{log} is no whole MCAP file")
    channels, found = {}, collections.defaultdict(list)

    def take(kind, body):
        if kind == CHANNEL:
            channels[struct.unpack_from("<H", body)[0]], _ = text_at(body, 4)
        elif kind == MESSAGE:
            channel, sequence, log_time, publish_time = struct.unpack_from("<HIQQ", body)
            found[channels[channel]].append(
                (sequence, log_time, publish_time, hashlib.sha256(body[22:]).hexdigest()))

    for kind, body in records(data[len(MAGIC) : -len(MAGIC)]):
        if kind != CHUNK:
            take(kind, body)
            continue
        compression, place = text_at(body, 28)
        if compression:
            fail(f"{log} is compressed: {compression}")
        for inner, inner_body in records(bytes(body[place + 8 :])):
            take(inner, inner_body)
    # A large message has a chunk of its own, which may be written before the small ones that came earlier.
    return {topic: sorted(entries, key=lambda entry: (entry[1], entry)) for topic, entries in found.items()
            if not topic.startswith("fastcycle/")}  # fmt: skip


def drive(program, application, time, log, *options):
    done = subprocess.run(
        [program, "run", application, "--clock", "simulated", "--for", time, "--quiet", "--set", f"logging.file={log}",
         "--set", "logging.except=[]", "--set", "logging.compression=none", *options],
        capture_output=True, text=True, cwd=log.parent)  # fmt: skip
    if done.returncode != 0:
        fail(f"{' '.join(options)}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return messages(log)


def verify(program, log):
    """All activations of all processes, executed again in one, publish the same."""
    report = log.with_suffix(".json")
    done = subprocess.run([program, "verify", log, "--report", report], capture_output=True, text=True, cwd=log.parent)
    if done.returncode != 0:
        fail(f"verify: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    components = json.loads(report.read_text())["components"]
    for name, one in components.items():
        if name != "fastcycle" and (not one["executed"] or one["activations"] != one["recorded_activations"]):
            fail(f"verify executed {one['activations']} of {one['recorded_activations']} activations of {name}: {one['why']}")
    print(f"verify: {sum(one['activations'] for one in components.values())} activations are the same")


def compare(alone, isolated, how):
    if set(alone) != set(isolated):
        fail(f"{how}: only one of the two has {sorted(set(alone) ^ set(isolated))}")
    for topic, expected in alone.items():
        found = isolated[topic]
        for place, (one, other) in enumerate(zip(expected, found)):
            if one != other:
                fail(f"{how}: {topic}, message {place + 1}: expected {one}, found {other}")
        if len(expected) != len(found):
            fail(f"{how}: {topic}: expected {len(expected)} messages, found {len(found)}")


def main():
    program, application = (os.path.abspath(word) for word in sys.argv[1:3])
    time, workers = sys.argv[3], sys.argv[4:] or ["2"]
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        alone = drive(program, application, time, folder / "alone.mcap")
        count = sum(len(entries) for entries in alone.values())
        if len(alone) < 10:
            fail(f"there is little to compare: {sorted(alone)}")
        for number in workers:
            isolated = drive(program, application, time, folder / f"isolated_{number}.mcap", "--isolate", "all", "--workers",
                             number)  # fmt: skip
            compare(alone, isolated, f"with {number} workers")
            verify(program, folder / f"isolated_{number}.mcap")
            print(f"{number} workers: {count} messages of {len(alone)} topics are the same")


main()
