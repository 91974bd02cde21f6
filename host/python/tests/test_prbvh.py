"""The module as a user has it; run by tests/python.rs, or by `python -m unittest` where it is installed."""

import os
import signal
import threading
import time
import unittest

import numpy as np

import prbvh


def soup(count, seed=1):
    """Small triangles in the unit cube: vertices, triangles."""
    random = np.random.default_rng(seed)
    middle = random.random((count, 1, 3), dtype=np.float32)
    vertices = middle + 0.05 * random.random((count, 3, 3), dtype=np.float32)
    return vertices.reshape(-1, 3), np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)


def faults(tree, low, high):
    """What is wrong with a tree over boxes, by a walk from the root."""
    found, seen = [], np.zeros(len(low), dtype=int)
    stack = [0]
    while stack:
        node = tree.nodes[stack.pop()]
        first, count = int(node["first"]), int(node["count"])
        if count == 0:
            children = tree.nodes[first : first + 2]
            below = children["min"].min(axis=0), children["max"].max(axis=0)
            stack += [first, first + 1]
        else:
            held = tree.order[first : first + count]
            seen[held] += 1
            below = low[held].min(axis=0), high[held].max(axis=0)
        if not (np.array_equal(node["min"], below[0]) and np.array_equal(node["max"], below[1])):
            found.append(f"box {node}")
    if (seen != 1).any():
        found.append("a primitive is not in one leaf")
    return found


def corners(vertices, triangles):
    points = vertices[triangles]
    return points.min(axis=1), points.max(axis=1)


class Trees(unittest.TestCase):
    def test_triangles(self):
        vertices, triangles = soup(3000)
        tree = prbvh.optimize(vertices, triangles, device="cpu")
        self.assertEqual(tree.nodes.dtype, prbvh.NODE)
        self.assertEqual(prbvh.NODE.itemsize, 32)
        self.assertEqual((tree.nodes.shape, tree.order.shape), ((5999,), (3000,)))
        self.assertEqual(tree.order.dtype, np.uint32)
        self.assertEqual(faults(tree, *corners(vertices, triangles)), [])
        report = tree.report
        self.assertLess(report["cost"], 0.9 * report["initial_cost"])
        self.assertEqual((report["stop"], report["leaves"], report["max_links"]), ("converged", 3000, None))
        rows = report["rows"]
        self.assertEqual(len(rows["cost"]), report["iterations"] + 1)
        self.assertEqual((rows["cost"].dtype, rows["applied"].dtype), (np.float64, np.uint32))
        self.assertTrue((np.diff(rows["time_s"]) >= 0).all())

    def test_without_indices_is_the_same(self):
        vertices, triangles = soup(500)
        with_indices = prbvh.optimize(vertices, triangles, device="cpu")
        without = prbvh.optimize(vertices, device="cpu")
        np.testing.assert_array_equal(with_indices.nodes, without.nodes)
        np.testing.assert_array_equal(with_indices.order, without.order)

    def test_boxes(self):
        low = np.random.default_rng(2).random((2000, 3), dtype=np.float32)
        high = low + np.float32(0.02)
        tree = prbvh.optimize_boxes(np.stack([low, high], axis=1), device="cpu", max_leaf=4)
        self.assertLess(len(tree.nodes), 3999)
        self.assertLessEqual(tree.nodes["count"].max(), 4)
        self.assertEqual(faults(tree, low, high), [])

    def test_a_planted_fault_is_found(self):
        vertices, triangles = soup(100)
        tree = prbvh.optimize(vertices, triangles, device="cpu")
        low, high = corners(vertices, triangles)
        tree.order[[0, 50]] = tree.order[[50, 0]]
        self.assertNotEqual(faults(tree, low, high), [])
        tree.order[0] = tree.order[1]
        self.assertIn("a primitive is not in one leaf", faults(tree, low, high))

    def test_options(self):
        vertices, triangles = soup(1000)
        for initial in ["lbvh", "ploc", "sah-binned", "sah-sweep", "trbvh", "hploc", "kmeans:q1", "aac:delta=8,epsilon=0.15"]:
            tree = prbvh.optimize(vertices, triangles, device="cpu", threads=1, initial=initial, max_iterations=2)
            self.assertEqual((tree.report["iterations"], tree.report["stop"]), (2, "iteration limit"))
        for optimizer in ["none", "rotations", "rbvh"]:
            tree = prbvh.optimize(vertices, triangles, device="cpu", initial="phr:fast", optimizer=optimizer, max_iterations=1)
            self.assertEqual(tree.report["iterations"], 0 if optimizer == "none" else 1)
            self.assertEqual(tree.report["cost"] < tree.report["initial_cost"], optimizer != "none")
        shallow = prbvh.optimize(vertices, triangles, device="cpu", max_depth=12)
        self.assertLessEqual(shallow.report["max_depth"], 12)
        self.assertEqual(shallow.report["max_links"], 12)
        cheap = prbvh.optimize(vertices, triangles, device="cpu", target_cost=1e9)
        self.assertEqual((cheap.report["iterations"], cheap.report["stop"]), (0, "target cost reached"))


class Mistakes(unittest.TestCase):
    def check(self, kind, text, call, *arguments, **options):
        with self.assertRaises(kind) as raised:
            call(*arguments, **options)
        self.assertIn(text, str(raised.exception))

    def test_arrays(self):
        vertices, triangles = soup(10)
        check, optimize = self.check, prbvh.optimize
        check(TypeError, "vertices must be a numpy array of float32, but is of type list", optimize, [[0.0] * 3])
        double = vertices.astype(np.float64)
        check(TypeError, "vertices must be of dtype float32, but is of float64", optimize, double, triangles)
        signed = triangles.astype(np.int64)
        check(TypeError, "triangles must be of dtype uint32, but is of int64", optimize, vertices, signed)
        flat = vertices.reshape(-1)
        check(ValueError, "vertices must have the shape (n, 3), but has (90)", optimize, flat, triangles)
        check(ValueError, "triangles must have the shape (n, 3), but has (15, 2)", optimize, vertices, triangles.reshape(-1, 2))
        check(ValueError, "vertices must be C-contiguous", optimize, np.asfortranarray(vertices), triangles)
        check(ValueError, "triangles must be C-contiguous", optimize, vertices, triangles[::2])
        check(ValueError, "vertices must be a multiple of 3 without triangles, but are 29", optimize, vertices[:29])
        triangles[4, 1] = 30
        check(ValueError, "triangles[4]: vertex 30 is not among the 30 vertices", optimize, vertices, triangles)
        vertices[7, 2] = np.nan
        check(ValueError, "NaN", optimize, vertices)
        check(ValueError, "no triangles", optimize, vertices[:0])
        boxes = np.zeros((3, 2, 3), dtype=np.float32)
        boxes[1, 0, 1] = 2
        check(ValueError, "boxes[1]: the smallest y is 2, above the largest, 0", prbvh.optimize_boxes, boxes)
        check(ValueError, "boxes must have the shape (n, 2, 3), but has (3, 3)", prbvh.optimize_boxes, boxes[:, 0].copy())

    def test_options(self):
        vertices, _ = soup(10)
        for name, value, text in [
            ("device", "tpu", 'device is "tpu", but must be auto, cpu, vulkan or vulkan:N'),
            ("initial", "random", 'initial is "random", but must be one of lbvh'),
            ("initial", "kmeans:k=65", "initial: kmeans.k is 65, but must be 2 to 64"),
            ("optimizer", "best", 'optimizer is "best", but must be one of prbvh, rbvh'),
            ("max_leaf", 0, "max_leaf is 0, but must be at least 1"),
            ("max_depth", 0, "max_depth is 0, but must be at least 1, or None"),
            ("max_depth", 2, "max_depth"),
            ("max_time", -1.0, "max_time is -1"),
            ("target_cost", float("nan"), "target_cost is NaN"),
        ]:
            self.check(ValueError, text, prbvh.optimize, vertices, **{"device": "cpu", name: value})
        self.check(prbvh.PrbvhError, "1000", prbvh.optimize, vertices, device="vulkan:1000")


class Running(unittest.TestCase):
    def test_progress_ends_a_run_with_a_tree(self):
        vertices, triangles = soup(3000)
        told = []

        def progress(row):
            told.append(row)
            return row["iteration"] == 2

        tree = prbvh.optimize(vertices, triangles, device="cpu", progress=progress)
        self.assertEqual([row["iteration"] for row in told], [0, 1, 2])
        # Some iterations are made together.
        self.assertGreaterEqual(tree.report["iterations"], 2)
        self.assertEqual(tree.report["stop"], "cancelled")
        self.assertEqual(faults(tree, *corners(vertices, triangles)), [])

    def test_what_progress_raises_is_raised(self):
        def progress(row):
            raise LookupError(f"planted {row['iteration']}")

        with self.assertRaisesRegex(LookupError, "planted 0"):
            prbvh.optimize(*soup(100), device="cpu", progress=progress)

    def test_other_threads_run_meanwhile(self):
        vertices, triangles = soup(30000)
        counted, done = [0], threading.Event()

        def count():
            while not done.is_set():
                counted[0] += 1
                time.sleep(0.001)

        counter = threading.Thread(target=count)
        counter.start()
        before, start = counted[0], time.monotonic()
        prbvh.optimize(vertices, triangles, device="cpu")
        during, took = counted[0] - before, time.monotonic() - start
        done.set()
        counter.join()
        # Without the lock given away the other thread would stand still all the time.
        self.assertGreater(during, 10 * took)

    def test_ctrl_c_ends_it_soon(self):
        # Whoever starts tests in the background may have it ignored.
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        self.addCleanup(signal.signal, signal.SIGINT, before)
        vertices, triangles = soup(30000)
        main = threading.main_thread().ident
        rows = []

        def progress(row):
            rows.append(row)
            if len(rows) == 3:
                signal.pthread_kill(main, signal.SIGINT)

        with self.assertRaises(KeyboardInterrupt):
            prbvh.optimize(vertices, triangles, device="cpu", progress=progress)
        self.assertLessEqual(len(rows), 4)
        # And the next run is none the worse.
        prbvh.optimize(*soup(10), device="cpu")


class Package(unittest.TestCase):
    def test_stubs_name_what_there_is(self):
        folder = os.path.dirname(prbvh.__file__)
        self.assertTrue(os.path.exists(os.path.join(folder, "py.typed")))
        with open(os.path.join(folder, "__init__.pyi"), encoding="utf-8") as stubs:
            text = stubs.read()
        for name in prbvh.__all__:
            self.assertIn(name, text)
        compile(text, "__init__.pyi", "exec")


if __name__ == "__main__":
    unittest.main()
