#!/usr/bin/env python3
"""Hostile and slow clients against the live server of a run, beside a client that behaves.

Usage: attack.py FASTCYCLE LIBRARIES SECONDS

Runs an application of LIBRARIES (live_parts) with --live. Concurrently there are clients that never read, one that
reads 10 kB a second, connections without a token, and clients that send random operations: broken JSON, wrong codes,
huge lengths, halves of frames. The well-behaved client has to get its topic in order, the run has to go on, and its
memory must not grow over time. Prints counts; exits with 1 on any error.
"""

import base64
import json
import os
import pathlib
import random
import re
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

APPLICATION = {
    "name": "attacked",
    "components": [
        {"name": "sensor", "library": "live_parts", "class": "Sensor", "serve_period_ms": 10,
         "params": {"image_bytes": 500000}},
        {"name": "filter", "library": "live_parts", "class": "Filter"},
    ],
    "live": {"port": 0, "publish": ["orders"]},
}
GROWTH_KIB = 48 << 10  # More than this from the first third of the time to the last is growth.
PATIENCE_S = 60


class WebSocket:
    """A client's end, without any politeness of a library."""

    def __init__(self, port, token, receive_buffer=None, subprotocol="foxglove.sdk.v1"):
        self.socket = socket.socket()
        self.socket.settimeout(PATIENCE_S)
        if receive_buffer is not None:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        self.socket.connect(("127.0.0.1", port))
        key = base64.b64encode(os.urandom(16)).decode()
        self.socket.sendall(
            (f"GET /?token={token} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
             f"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n"
             f"Sec-WebSocket-Protocol: {subprotocol}\r\n\r\n").encode())
        self.left = b""
        while b"\r\n\r\n" not in self.left:
            self.left += self._some()
        head, self.left = self.left.split(b"\r\n\r\n", 1)
        if b" 101 " not in head.split(b"\r\n")[0]:
            raise ConnectionError(head.split(b"\r\n")[0].decode())

    def _some(self):
        data = self.socket.recv(1 << 16)
        if not data:
            raise ConnectionError("closed")
        return data

    def _exactly(self, count):
        while len(self.left) < count:
            self.left += self._some()
        data, self.left = self.left[:count], self.left[count:]
        return data

    def send(self, payload, code=1, length=None):
        """A frame; `length` is what it says of its length, if that is not the truth."""
        said = len(payload) if length is None else length
        head = bytes([0x80 | code])
        if said < 126:
            head += bytes([0x80 | said])
        elif said < 1 << 16:
            head += bytes([0x80 | 126]) + struct.pack("!H", said)
        else:
            head += bytes([0x80 | 127]) + struct.pack("!Q", said)
        mask = os.urandom(4)
        stretched = mask * (len(payload) // 4 + 1)
        masked = bytes(a ^ b for a, b in zip(payload, stretched))
        self.socket.sendall(head + mask + masked)

    def read(self):
        """The code and the payload of the next frame; pings are answered."""
        while True:
            first, second = self._exactly(2)
            size = second & 0x7F
            if size == 126:
                size, = struct.unpack("!H", self._exactly(2))
            elif size == 127:
                size, = struct.unpack("!Q", self._exactly(8))
            payload = self._exactly(size)
            if first & 0xF == 9:
                self.send(payload, code=10)
            elif first & 0xF == 8:
                raise ConnectionError("closed")
            else:
                return first & 0xF, payload

    def channels(self):
        while True:
            code, payload = self.read()
            if code == 1:
                said = json.loads(payload)
                if said["op"] == "advertise":
                    return {channel["topic"]: channel["id"] for channel in said["channels"]}

    def subscribe(self, ids):
        self.send(json.dumps({"op": "subscribe", "subscriptions": [
            {"id": number + 1, "channelId": channel} for number, channel in enumerate(ids)]}).encode())

    def close(self):
        self.socket.close()


class Attack:
    def __init__(self, program, url, seconds):
        self.program = program
        self.port = int(re.search(r":(\d+)/", url).group(1))
        self.token = url.split("token=")[1]
        self.end = time.monotonic() + seconds
        self.counts = {"received": 0, "operations": 0, "refused": 0, "dropped": 0}
        self.wrong = []
        self.lock = threading.Lock()

    def goes_on(self):
        return time.monotonic() < self.end and not self.wrong

    def count(self, what, number=1):
        with self.lock:
            self.counts[what] += number

    def connect(self, **options):
        return WebSocket(self.port, self.token, **options)

    # ---- Each in a thread of its own ----

    def behave(self):
        client = self.connect()
        client.subscribe([client.channels()["sensor/filtered"]])
        last = 0
        while self.goes_on():
            code, payload = client.read()
            if code == 2 and payload[0] == 1:
                at, = struct.unpack("<Q", payload[5:13])
                if at <= last:
                    self.wrong.append("a message came twice or in another order")
                last = at
                self.count("received")
        client.close()

    def never_read(self):
        while self.goes_on():
            try:
                client = self.connect(receive_buffer=4096)
                client.subscribe(client.channels().values())
                until = min(self.end, time.monotonic() + 20)
                while time.monotonic() < until and not self.wrong:
                    time.sleep(0.1)
                client.close()
            except OSError:
                self.count("dropped")
                time.sleep(0.1)

    def read_slowly(self):
        while self.goes_on():
            try:
                client = self.connect(receive_buffer=4096)
                client.subscribe(client.channels().values())
                while self.goes_on():
                    client.socket.recv(1000)
                    time.sleep(0.1)
                client.close()
            except OSError:
                self.count("dropped")
                time.sleep(0.1)

    def knock(self):
        """Connections that are none: no token, a wrong one, another origin, a large header, half a request."""
        requests = [
            "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
            f"GET /?token={'0' * 32} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
            f"GET /?token={self.token} HTTP/1.1\r\nHost: evil.example\r\n\r\n",
            f"GET /?token={self.token} HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: https://evil.example\r\n\r\n",
            "GET / HTTP/1.1\r\nX: " + "x" * (10 << 20),
            "\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
            "GET",
        ]
        while self.goes_on():
            try:
                with socket.create_connection(("127.0.0.1", self.port), timeout=PATIENCE_S) as knocking:
                    request = random.choice(requests)
                    knocking.sendall(request.encode("latin-1"))
                    if request != "GET" and b" 200 " in knocking.recv(64):
                        self.wrong.append(f"let in by {request[:80]!r}")
            except OSError:
                pass
            self.count("refused")

    def send_nonsense(self):
        rng = random.Random()
        right = [
            {"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 1}]},
            {"op": "unsubscribe", "subscriptionIds": [1]},
            {"op": "getParameters", "parameterNames": [], "id": "a"},
            {"op": "setParameters", "parameters": [{"name": "filter.gain", "value": 2}]},
            {"op": "subscribeParameterUpdates", "parameterNames": ["filter.gain"]},
            {"op": "subscribeConnectionGraph"},
            {"op": "advertise", "channels": [{"id": 1, "topic": "orders", "encoding": "protobuf",
                                              "schemaName": "live.Reading"}]},
            {"op": "unadvertise", "channelIds": [1]},
            {"op": "fetchAsset", "uri": "file:///etc/passwd", "requestId": 1},
        ]
        while self.goes_on():
            try:
                client = self.connect(subprotocol=rng.choice(["foxglove.sdk.v1", "foxglove.websocket.v1"]))
                client.socket.setblocking(True)
                for _ in range(rng.randrange(1, 200)):
                    self.nonsense(client, rng, right)
                    self.count("operations")
                client.close()
            except OSError:
                pass

    def nonsense(self, client, rng, right):
        kind = rng.randrange(8)
        text = json.dumps(rng.choice(right)).encode()
        if kind == 0:  # Broken JSON: a piece is missing, or a byte is another one.
            at = rng.randrange(len(text))
            client.send(text[:at] + bytes([rng.randrange(256)]) * rng.randrange(2) + text[at + 1:])
        elif kind == 1:  # Values of other types.
            said = json.loads(text)
            said[rng.choice(list(said))] = rng.choice([None, -1, 1e300, [], {}, "x" * 1000, [[[]]], True])
            client.send(json.dumps(said).encode())
        elif kind == 2:
            client.send(text)
        elif kind == 3:  # Binary: messages and calls, with lengths that are none.
            client.send(bytes([rng.randrange(6)]) + os.urandom(rng.randrange(64)), code=2)
        elif kind == 4:
            client.send(b"\x02" + struct.pack("<II", 1, 1) + struct.pack("<I", 0xFFFFFFFF) + b"protobuf", code=2)
        elif kind == 5:  # A code that there is not, or a fragment without a beginning.
            client.send(text, code=rng.choice([0, 3, 7, 11, 15]))
        elif kind == 6:  # A frame that says that it is larger than it is, and then nothing.
            client.send(text, length=rng.choice([len(text) + 1, 1 << 20, 1 << 40, (1 << 63) - 1]))
        else:  # Nested deeper than anybody reads.
            client.send(b"[" * rng.choice([10, 1000, 100000]))
        if rng.randrange(100) == 0:
            client.socket.sendall(os.urandom(rng.randrange(1, 2000)))

    def run(self):
        watching = [self.behave, self.read_slowly, self.knock, self.send_nonsense, self.send_nonsense]
        watching += [self.never_read] * 4

        def guarded(body):
            try:
                body()
            except Exception as error:  # pylint: disable=broad-except
                self.wrong.append(f"{body.__name__}: {error}")

        threads = [threading.Thread(target=guarded, args=(body,), daemon=True) for body in watching]
        begin = time.monotonic()
        for thread in threads:
            thread.start()
        largest = [0, 0, 0]  # In each third of the time.
        while self.goes_on():
            if self.program.poll() is not None:
                self.wrong.append(f"the run ended with {self.program.returncode}")
                break
            pages = int(pathlib.Path(f"/proc/{self.program.pid}/statm").read_text().split()[1])
            third = min(2, int(3 * (time.monotonic() - begin) / (self.end - begin)))
            largest[third] = max(largest[third], pages * os.sysconf("SC_PAGESIZE") >> 10)
            time.sleep(0.05)
        for thread in threads:
            thread.join(PATIENCE_S)
        if largest[2] > largest[0] + GROWTH_KIB:
            self.wrong.append(f"memory grows: {largest} KiB")
        if self.counts["received"] == 0:
            self.wrong.append("the well-behaved client got nothing")
        return largest


def main():
    program, libraries = (str(pathlib.Path(path).resolve()) for path in sys.argv[1:3])
    seconds = float(sys.argv[3])
    with tempfile.TemporaryDirectory() as folder:
        pathlib.Path(folder, "app.json").write_text(json.dumps(APPLICATION))
        with subprocess.Popen([program, "run", "app.json", "--library-path", libraries, "--quiet", "--inspect-allow",
                               "params,publish"], cwd=folder, stderr=subprocess.PIPE, text=True,
                              env={**os.environ, "XDG_RUNTIME_DIR": folder}) as run:
            url, lines = "", []
            for line in run.stderr:
                lines.append(line)
                if line.startswith("live: http"):
                    url = line.split()[1]
                    break
            drain = threading.Thread(target=lambda: lines.extend(run.stderr), daemon=True)
            drain.start()
            if not url:
                sys.exit("attack: the run did not begin: " + "".join(lines))
            attack = Attack(run, url, seconds)
            largest = attack.run()
            is_alive = run.poll() is None
            if is_alive:
                run.terminate()
            code = run.wait(PATIENCE_S)
            drain.join(PATIENCE_S)
        if is_alive and code != 0:
            attack.wrong.append(f"the run ended with {code}")
        counts = attack.counts
        print(f"live: {counts['operations']} operations that are nonsense, {counts['refused']} connections refused, "
              f"{counts['received']} messages to who behaves; at most {[kib >> 10 for kib in largest]} MiB in each "
              "third of the time")
        if attack.wrong:
            print("".join(lines[-20:]), file=sys.stderr)
            sys.exit("attack: " + "; ".join(attack.wrong))


if __name__ == "__main__":
    main()
