#!/usr/bin/env python3
"""keystore_test.py PROGRAM gateway|none: `fastcycle security` permits what an application's gateway lists, never writes
over what is there, and says why it refuses; `fastcycle check` finds a wrong enclave, where the gateway was built."""

import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

PROGRAM, HAS_GATEWAY = sys.argv[1], sys.argv[2] == "gateway"


def application(*more, **params):
    gateway = {"name": "gateway", "library": "dds_gateway", "params": params}
    return {"name": "app", "components": [gateway, *more]}


class Keystore(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        self.folder = pathlib.Path(self.scratch.name)

    def run_program(self, *words):
        return subprocess.run([PROGRAM, *words], cwd=self.folder, capture_output=True, text=True)

    def security(self, *words):
        done = self.run_program("security", *words)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def assert_refused(self, said, *words):
        before = {path: path.read_bytes() for path in self.folder.rglob("*") if path.is_file()}
        done = self.run_program("security", *words)
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        self.assertIn(said, done.stderr)
        self.assertEqual({path: path.read_bytes() for path in self.folder.rglob("*") if path.is_file()}, before)

    def write(self, content):
        (self.folder / "app.json").write_text(json.dumps(content), encoding="utf-8")

    def permitted(self, name):
        """What the enclave may: the domains, the topics to publish, those to subscribe to."""
        text = (self.folder / "keys/enclaves" / name / "permissions.xml").read_text(encoding="utf-8")
        found = [re.findall(r"<id>(\d+)</id>", text)]
        for verb in ("publish", "subscribe"):
            rule = re.search(rf"<{verb}>(.*?)</{verb}>", text, flags=re.S)
            found.append(re.findall(r"<topic>(.*?)</topic>", rule[1]) if rule else [])
        return found

    def test_the_gateway_may_do_what_it_lists_each_in_its_direction(self):
        self.write(application(
            domain=42, clock_period_ms=10,
            topics=[{"topic": "cloud", "direction": "in", "ros": "points", "type": "sensor_msgs/msg/PointCloud2"},
                    {"topic": "scene", "direction": "out", "ros": "/objects", "type": "x_msgs/msg/Unknown"},
                    {"topic": "planning/path", "direction": "out", "message": "planning.Path"}],
            services=[{"service": "a", "direction": "in", "ros": "/release", "type": "std_srvs/srv/SetBool"},
                      {"service": "b", "direction": "out", "ros": "/reset", "type": "std_srvs/srv/Trigger"}]))
        self.security("init", "keys")

        said = self.security("add", "keys", "gateway", "app.json")

        self.assertEqual(self.permitted("gateway"), [
            ["42"],
            ["fastcycle/planning/path", "fastcycle_clocks", "ros_discovery_info", "rq/resetRequest", "rr/releaseReply", "rt/clock",
             "rt/objects"],
            ["fastcycle_clocks", "ros_discovery_info", "rq/releaseRequest", "rr/resetReply", "rt/points"]])
        self.assertIn('"security": "' + str(self.folder / "keys/enclaves/gateway"), said)

    def test_a_gateway_that_shows_parameters_may_answer_for_them(self):
        self.write(application(node="/car/gate", parameters=[{"param": "limiter.*"}]))
        self.security("init", "keys")

        self.security("add", "keys", "gateway", "app.json")

        services = ("describe_parameters", "get_parameter_types", "get_parameters", "list_parameters", "set_parameters",
                    "set_parameters_atomically")
        self.assertEqual(self.permitted("gateway"), [
            ["0"],
            ["ros_discovery_info", *(f"rr/car/gate/{name}Reply" for name in services)],
            ["ros_discovery_info", *(f"rq/car/gate/{name}Request" for name in services)]])

    def test_others_may_do_what_is_permitted(self):
        self.security("init", "keys")
        self.security("add", "keys", "car/driver", "--domain", "7", "--publish", "/points", "--subscribe", "speed",
                      "--serve", "reset", "--call", "/release", "--node", "/car/driver")

        domains, publish, subscribe = self.permitted("car/driver")

        self.assertEqual(domains, ["7"])
        for topic in ("rt/points", "rr/resetReply", "rq/releaseRequest", "rt/rosout", "rr/car/driver/get_parametersReply"):
            self.assertIn(topic, publish)
        for topic in ("rt/speed", "rq/resetRequest", "rr/releaseReply", "rq/car/driver/get_parametersRequest"):
            self.assertIn(topic, subscribe)

    def test_what_is_there_stays(self):
        self.security("init", "keys")
        self.security("add", "keys", "gateway")

        self.assert_refused("keys: it is there already", "init", "keys")
        self.assert_refused("gateway: it is there already", "add", "keys", "gateway")

    def test_what_cannot_be_is_refused(self):
        self.assert_refused("keys/public/identity_ca.cert.pem: expected a file of a keystore", "add", "keys", "gateway")
        self.security("init", "keys")
        self.assert_refused('found "/../x"', "add", "keys", "../x")
        self.assert_refused('"a b" is not a valid ROS 2 name', "add", "keys", "gateway", "--publish", "a b")
        self.assert_refused("--domain", "add", "keys", "gateway", "--domain", "231")
        self.assert_refused("--days", "add", "keys", "gateway", "--days", "0")

    def test_reports_errors_of_an_application_with_their_places(self):
        self.security("init", "keys")
        self.write(application(domain=232, topics=[{"topic": "a", "direction": "up", "ros": "/a", "type": "x/Y"},
                                                   {"topic": "a<b", "direction": "in", "message": "x.Y"}]))
        self.assert_refused("/components/0/params/domain: expected a whole number from 0 to 230", "add", "keys", "g", "app.json")
        self.assert_refused('topics/0/direction: expected in or out, found "up"', "add", "keys", "g", "app.json")
        self.assert_refused("topics/1/topic: expected a name without blanks", "add", "keys", "g", "app.json")
        self.write({"name": "app", "components": [{"name": "limiter", "library": "speed_limiter"}]})
        self.assert_refused("app.json has no component of the library dds_gateway", "add", "keys", "g", "app.json")
        self.write(application({"name": "second", "library": "dds_gateway"}))
        self.assert_refused("several gateways: gateway, second; select one with --component NAME", "add", "keys", "g", "app.json")
        self.security("add", "keys", "g", "app.json", "--component", "second")

    @unittest.skipUnless(HAS_GATEWAY, "needs the gateway")
    def test_check_finds_a_wrong_enclave(self):
        self.security("init", "keys")
        self.security("add", "keys", "gateway")
        self.security("add", "keys", "other")
        self.write(application(security="keys/enclaves/gateway"))
        done = self.run_program("check", "app.json")
        self.assertEqual(done.returncode, 0, done.stderr)

        key = self.folder / "keys/enclaves/gateway/key.pem"
        key.write_bytes((self.folder / "keys/enclaves/other/key.pem").read_bytes())
        done = self.run_program("check", "app.json")

        self.assertEqual(done.returncode, 2)
        self.assertIn(f"{key}: expected the private key of the certificate in cert.pem, found another one", done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
