"""cairn-run on programs that know nothing of Cairn: it solves for them, in both precisions, or says why it cannot."""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

parser = argparse.ArgumentParser()
for name in ("--cairn-run", "--host", "--static", "--old"):
    parser.add_argument(name, required=True)
for name in ("--float", "--double"):
    parser.add_argument(name, nargs=2, metavar=("PROGRAM", "PLUGIN"))
options, rest = parser.parse_known_args()
PRECISIONS = {name: given for name in ("float", "double") if (given := getattr(options, name))}
FEW = ("--threads", "1", "--iterations", "100", "--substeps", "10")
STEPS = 100
NOT_STARTED = 125


def plain(*command: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    clean = {name: value for name, value in os.environ.items() if not name.startswith("CAIRN_")}
    return subprocess.run(command, env={**clean, **environment}, capture_output=True, text=True, timeout=300)


def cairn(*arguments: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    return plain(options.cairn_run, *arguments, **environment)


def gap_and_top(done: "subprocess.CompletedProcess[str]") -> "tuple[float, float]":
    gap, top = done.stdout.split()
    return float(gap), float(top)


class Solves(unittest.TestCase):
    def check_solved(self, done: "subprocess.CompletedProcess[str]", steps: int = STEPS) -> None:
        self.assertEqual(done.returncode, 7, done.stderr)
        gap, top = gap_and_top(done)
        self.assertLess(gap, 0.02, "Cairn holds the chain")
        self.assertAlmostEqual(top, 2.5, delta=0.01)
        self.assertIn(f"100 iterations in 10 substeps: {steps} steps", done.stderr)
        self.assertNotIn("left", done.stderr)

    def test_in_both_precisions(self) -> None:
        for precision, (program, _) in PRECISIONS.items():
            with self.subTest(precision):
                stock = plain(program, "plain", str(STEPS))
                self.assertGreater(gap_and_top(stock)[0], 0.3, "stock stretches it")
                self.check_solved(cairn(*FEW, "--", program, "plain", str(STEPS)))

    def test_with_a_plugin_that_comes_late(self) -> None:
        for precision, (_, plugin) in PRECISIONS.items():
            with self.subTest(precision):
                self.check_solved(cairn("--late", *FEW, options.host, plugin, "plain", str(STEPS)))

    def test_in_a_script(self) -> None:
        for program, _ in PRECISIONS.values():
            with tempfile.TemporaryDirectory() as folder:
                script = Path(folder) / "script"
                script.write_text(f"#!/bin/sh\nexec {program} plain {STEPS}\n")
                script.chmod(0o755)
                self.check_solved(cairn("--late", *FEW, str(script)))

    def test_each_solver_has_its_own_state(self) -> None:
        for program, _ in PRECISIONS.values():
            done = cairn(*FEW, "--stats", "--", program, "again", str(STEPS))
            self.check_solved(done, steps=6 * STEPS)
            self.assertRegex(done.stderr, r"solvers +6\n")
            # A solver at the address of another starts cold, as that did.
            once = cairn(*FEW, "--", program, "plain", str(STEPS))
            self.assertEqual(done.stdout, once.stdout)

    def test_in_a_world_that_steps_in_its_own_way(self) -> None:
        for program, _ in PRECISIONS.values():
            done = cairn(*FEW, "--", program, "own", str(STEPS))
            self.assertLess(gap_and_top(done)[0], 0.02)
            self.assertIn(f"10 substeps: {STEPS + 1} solves of", done.stderr)

    def test_in_a_pool(self) -> None:
        for program, _ in PRECISIONS.values():
            self.check_solved(cairn(*FEW, "--", program, "pool", str(STEPS)))

    def test_figures(self) -> None:
        for program, _ in PRECISIONS.values():
            done = cairn(*FEW, "--stats", "--", program, "plain", str(STEPS))
            # The first step comes in two parts: 150 manifolds and 20 constraints are more than Bullet's 128.
            self.assertIn(" 1.01 solves, 170.0 bodies, 600.0 contacts, 20.0 joints", done.stderr)
            told = re.search(r"joint gap median ([\d.]+) mm, worst ([\d.]+) mm", done.stderr)
            assert told, done.stderr
            self.assertLessEqual(float(told[2]), 1e3 * gap_and_top(done)[0] + 1e-3)
            self.assertGreater(float(told[2]), 0)
            residual = re.search(r"residual +median ([\d.e-]+), worst ([\d.e-]+) sqrt", done.stderr)
            assert residual, done.stderr
            self.assertGreater(float(residual[1]), 0)

    def test_preset_follows_the_program(self) -> None:
        program = next(iter(PRECISIONS.values()))[0]
        self.assertIn("tj, 300 iterations in 10 substeps: 2 steps", cairn("--method=tj", program, "plain", "2").stderr)

    def test_settings_come_from_the_environment_too(self) -> None:
        program = next(iter(PRECISIONS.values()))[0]
        done = cairn(program, "plain", "2", CAIRN_METHOD="pj", CAIRN_ITERATIONS="50")
        self.assertIn("pj, 50 iterations in 1 substep: 2 steps", done.stderr)

    def test_quiet(self) -> None:
        program = next(iter(PRECISIONS.values()))[0]
        self.assertEqual(cairn("--quiet", program, "plain", "2").stderr, "")


class Library(unittest.TestCase):
    def test_exports_nothing_but_bullets_functions(self) -> None:
        """A C++ runtime of ours before the program's own would be its end."""
        preload = str(Path(options.cairn_run).parent / "libcairn_bullet_preload.so")
        symbols = plain("nm", "-D", "--defined-only", preload).stdout.split()[2::3]
        self.assertGreater(len(symbols), 5)
        for symbol in symbols:
            self.assertRegex(symbol, "^_ZN(35btSequentialImpulseConstraintSolver|23btDiscreteDynamicsWorld)")


class LeavesToBullet(unittest.TestCase):
    def test_other_solvers(self) -> None:
        kinds = {"nncg": "btNNCGConstraintSolver", "mlcp": "btMLCPSolver", "derived": "Derived"}
        for program, _ in PRECISIONS.values():
            for kind, name in kinds.items():
                with self.subTest(kind):
                    stock, done = plain(program, kind, "5"), cairn(program, kind, "5")
                    self.assertEqual(done.stdout, stock.stdout, "the same bits as without Cairn")
                    self.assertEqual(done.returncode, 7)
                    self.assertRegex(done.stderr, rf"cairn: \d+ calls of solveGroup of .*{name} were left to Bullet")

    def test_stock_is_measured(self) -> None:
        for program, _ in PRECISIONS.values():
            stock, done = plain(program, "plain", "20"), cairn("--method", "stock", "--stats", program, "plain", "20")
            self.assertEqual(done.stdout, stock.stdout)
            self.assertIn("cairn: Bullet's own solver: 20 steps", done.stderr)
            self.assertIn("widest joint gap", done.stderr)

    def test_bad_settings_without_cairn_run(self) -> None:
        preload = str(Path(options.cairn_run).parent / "libcairn_bullet_preload.so")
        program = next(iter(PRECISIONS.values()))[0]
        stock = plain(program, "plain", "5")
        done = plain(program, "plain", "5", LD_PRELOAD=preload, CAIRN_METHOD="best")
        self.assertEqual(done.stdout, stock.stdout)
        self.assertIn('CAIRN_METHOD is "best"', done.stderr)

    def test_no_bullet_that_comes_late(self) -> None:
        done = cairn("--late", "/bin/true")
        self.assertEqual(
            (done.returncode, done.stderr), (0, "cairn: no btSequentialImpulseConstraintSolver was called\n")
        )


class Refuses(unittest.TestCase):
    def check_refused(self, reason: str, *arguments: str, **environment: str) -> None:
        done = cairn(*arguments, **environment)
        self.assertEqual(done.returncode, NOT_STARTED, done.stderr)
        self.assertEqual(done.stdout, "")
        self.assertIn(reason, done.stderr)

    def test_static_bullet(self) -> None:
        self.check_refused("has Bullet linked in statically", options.static)

    def test_another_version(self) -> None:
        self.check_refused(
            "the program's Bullet is libBulletDynamics.so.2.88, but Cairn was built for Bullet 3", options.old
        )

    def test_a_precision_that_was_not_built(self) -> None:
        build = Path(options.cairn_run).parent
        for precision, (program, _) in PRECISIONS.items():
            with tempfile.TemporaryDirectory() as folder:
                for name in ("cairn-run", "libcairn_bullet_preload.so"):
                    (Path(folder) / name).write_bytes((build / name).read_bytes())
                (Path(folder) / "cairn-run").chmod(0o755)
                done = plain(str(Path(folder) / "cairn-run"), program, "plain", "1")
                self.assertEqual(done.returncode, NOT_STARTED)
                self.assertIn(
                    f"in {precision}s, but Cairn was built without libcairn_bullet_{precision}.so", done.stderr
                )

    def test_no_bullet(self) -> None:
        self.check_refused("is not linked to a shared Bullet", "/bin/true")

    def test_a_library_that_is_missing(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            lonely = Path(folder) / "old_program"
            data = Path(options.old).read_bytes()
            lonely.write_bytes(
                data.replace(
                    str(Path(options.old).parent).encode(), b"/nowhere".ljust(len(str(Path(options.old).parent)), b"x")
                )
            )
            lonely.chmod(0o755)
            self.check_refused("not found", str(lonely))

    def test_a_script(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            script = Path(folder) / "script"
            script.write_text("#!/bin/sh\n")
            script.chmod(0o755)
            self.check_refused("a script", str(script))

    def test_what_is_not_there(self) -> None:
        self.check_refused("nowhere is not found", "nowhere")

    def test_settings(self) -> None:
        program = next(iter(PRECISIONS.values()))[0]
        self.check_refused('CAIRN_METHOD is "best"', "--method", "best", program)
        self.check_refused('CAIRN_ITERATIONS is "-1"', "--iterations", "-1", program)
        self.check_refused("iterations is 0", "--iterations", "0", program)
        self.check_refused("substeps is 4", "--method", "pj", "--substeps", "4", program)
        self.check_refused("threads is 5000", "--threads", "5000", program)
        self.check_refused('CAIRN_PRESET is "x"', "--preset=x", program)
        self.check_refused("unknown option --fast", "--fast", program)
        self.check_refused("no program", "--stats")


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *rest])
