"""The `domino` command: its input, output and error messages."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tqdm import tqdm

import domino_env as de
from domino_env.cli.main import main
from domino_env.core.progress import notice

GAPS, THICKNESS = [0.018, 0.0205, 0.022, 0.016], [0.0075, 0.007, 0.0075, 0.0075, 0.0075]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A layout in millimetres, as a spreadsheet with decimal commas writes it."""
    path = tmp_path / "row.csv"
    path.write_text("spacing_mm;thickness_mm\n18,0;7,5\n20,5;7\n22;7,5\n16;7,5\n;7,5\n")
    return path


def test_simulate_prints_arrival_times_speed_and_how_the_wave_ended(output_of, file):
    text = output_of("simulate", file)
    wave = de.simulate(de.Layout(GAPS, THICKNESS), de.Physics())
    table = [line.split() for line in text.splitlines()[1:6]]
    assert [int(cells[0]) for cells in table] == [0, 1, 2, 3, 4]
    assert [float(cells[1]) for cells in table[:4]] == pytest.approx(1e3 * np.array(GAPS))
    assert [float(cells[3]) for cells in table[1:4]] == pytest.approx(
        wave.arrival_times[1:4], abs=1e-6
    )
    speeds = np.diff(wave.layout.positions) / np.diff(wave.arrival_times)
    assert [float(cells[4]) for cells in table[1:4]] == pytest.approx(speeds[:3], abs=1e-4)
    assert "PROPAGATED: the wave completed" in text
    assert f"mean speed {wave.mean_speed:.6f} m/s over 0.1060 m" in text
    assert "relative error of the times below" in text


def test_simulate_shows_free_standing_dominoes_too(output_of, file):
    text = output_of("simulate", file, "--floor", 0.4)
    standing = de.simulate_standing(de.Layout(GAPS, THICKNESS), de.Physics(), 0.4)
    assert f"mean speed {standing.mean_speed:.5f} m/s, " in text
    assert "5 of 5 toppled" in text
    document = json.loads(output_of("simulate", file, "--floor", 0.4, "--json"))
    assert document["free_standing"]["arrival_times"] == standing.arrival_times.tolist()


def test_the_two_ends_of_a_long_layout_are_printed(output_of, tmp_path):
    path = tmp_path / "long.csv"
    layout = de.Layout.uniform(5000, pitch=0.024)
    layout.to_csv(path)
    lines = output_of("simulate", path).splitlines()
    assert "4,980 lines left out: see --json" in lines[11]
    assert [int(line.split()[0]) for line in lines[1:11] + lines[12:22]] == [
        *range(10), *range(4990, 5000)
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["sprint", "tempo"])
def test_a_layout_is_compared_with_the_uniform_baseline_of_a_scene(output_of, tmp_path, name):
    scene = de.load_scene(name)
    layout = scene.layout(0.012, scene.thickness[1])
    layout.to_csv(tmp_path / "own.csv")
    words = "simulate", tmp_path / "own.csv", "--scene", name
    score, uniform = scene.score(layout), scene.uniform().score
    result = json.loads(output_of(*words, "--json"))
    assert (result["score"], result["gain"]) == pytest.approx((score, scene.gain(score, uniform)))
    shown = f"score {score:.6f} m/s on 'sprint', {1.0 - score / uniform:.2%} below"
    if name == "tempo":
        late, best = (
            scene.tempo.error(w.arrival_times[None])[0]
            for w in (scene.simulate(layout), scene.uniform().wave)
        )
        shown = f"RMS error {1e3 * late:.6g} ms on 'tempo', {1e3 * best:.4g} ms with"
    assert f"{shown} the uniform baseline" in output_of(*words)


def test_a_layout_is_scored_by_a_scene_unless_it_breaks_rules(output_of, file, tmp_path):
    de.load_scene("sprint").layout(0.012).to_csv(tmp_path / "own.csv")
    text = output_of("simulate", file, "--scene", "sprint", "--push", 9)
    assert "not a layout of scene 'sprint': the layout has 5 dominoes, and the scene 40" in text
    assert "score" not in text
    text = output_of("simulate", tmp_path / "own.csv", "--scene", "sprint", "--push", 9)
    assert "no score on 'sprint': these are not the friction, gravity and push of the" in text


def test_json_output_has_outcome_and_arrival_times(output_of, file):
    document = json.loads(output_of("simulate", file, "--json", "--push", 1.5))
    wave = de.simulate(de.Layout(GAPS, THICKNESS), de.Physics(push=1.5))
    assert document["outcome"] == "STALLED"
    assert "the push of 1.5 rad/s is too small" in document["explanation"]
    assert "gaps" not in document["explanation"]
    assert "error" not in output_of("simulate", file, "--push", 0.1)  # there are no times
    assert (document["hit"], document["mean_speed"]) == (wave.hit, 0.0)
    came = np.isfinite(wave.arrival_times)
    assert [t is not None for t in document["arrival_times"]] == came.tolist()
    assert not came.all()


SCENE = "scene --count 40 --thickness 7.5"


@pytest.mark.parametrize(("words", "message"), [
    ("simulate nothing.csv", "nothing.csv: there is no such file: name a layout or a run"),
    ("report nix row.csv", "nix: there is no such file: name a layout or a run folder"),
    ("measure a.wav --uniform 40,24", "a.wav: No such file or directory: name another file or"),
    ("measure a.wav --uniform 40", "'40': write COUNT,PITCH [mm], as in 40,24"),
    ("measure --layout row.csv", "row.csv: no recordings: name at least one"),
    ("measure a.wav", "no layout: name it by --layout FILE or --uniform COUNT,PITCH"),
    ("measure a.wav --uniform 9,24 --layout row.csv b.wav", "a.wav: with several layouts, write"),
    ("sweep sprint --workers two", "--workers: 'two': give a whole number"),
    ("studies --store empty.csv", "empty.csv holds no store: give the file of one (--store)"),
    ("studies show x --to x.csv", "--to and --best belong to domino studies export: leave"),
    ("studies list x", "domino studies list takes no name: domino studies show x"),
    ("simulate row.csv --friction 0,25", "'0,25': give a number, with a decimal point as in 0.25"),
    ("verify row.csv --floor 0.5,0", "--floor = 0.0: give a finite number, more than 0 (a coeff"),
    ("simulate one.csv --deviation 1", "--deviation = 1.0 mm: give a finite number, at most 0 ("),
    ("compare sprint --methods ,", "methods is empty: give at least one"),
    ("simulate row.csv --rate 2", "unrecognized arguments: --rate 2 (domino simulate --help)"),
    ("simulate mm.csv", "mm.csv: a domino is 7.5 m thick, and the dominoes are 0.048 m tall"),
    ("simulate .", ".: it is a folder without a layout.csv: name a run folder or a file"),
    ("optimize row.csv", "row.csv: a scene is a .toml file or a name; domino simulate reads"),
    ("click one.csv", "one.csv: no domino hits another, so there is no sound: a chain needs two"),
    ("click row.csv --push 0.1", "row.csv: no domino hits another, so there is no sound: the"),
    ("click row.csv --wav one.csv/x.wav", "one.csv is a file: name a folder"),
    ("validate 0.016=64", "x = 1.6e-05 is a gap of -0.007484 m: give more than 0"),
    ("validate nobody", "give a source (camera, "),
    ("validate 16=x", "write PITCH=FREQUENCY"),
    ("accuracy --seconds 0", "--seconds = 0.0 s: give a finite number, more than 0"),
    ("optimise sprint", "COMMAND = 'optimise': did you mean 'optimize'? choose"),
    ("verify row.csv --floor rough", "--floor: 'rough': give a number"),
    ("evaluate designer --scenes 201", "at most 200 (the test set of varied"),
    ("render row.csv", "give --gif FILE, --mp4 FILE or --png FILE"),
    ("render row.csv --png out.gif", "--png: out.gif: name a .png file"),
    ("render row.csv --png out.png --moments 0", "moments = 0: give a whole number"),
    ("render row.csv --gif out.gif --rate 60", "rate = 60.0 Hz: give a finite number, more"),
    ("render row.csv --gif out.gif --slow 0", "slow = 0.0: give a finite number, more than 0"),
    ("render row.csv --gif out.gif --width 401", "give an even number"),
    ("render row.csv --png out.png --width 10000000",
     "width = 10000000 px: give a whole number from 200 to 10"),
    ("render row.csv --png out.png --moments 100000",
     "pixels: at most 500,000,000 are drawn; choose a lower --w"),
    ("render row.csv --gif out.gif --width 10000 --slow 300",
     "pixels: at most 500,000,000 are drawn; choose"),
    (f"{SCENE} --length 9000", "row.length = 9 m cannot be met: 40 dominoes within the bounds "
     "cover 0.3705 to 1.7901 m; row.count = 198 to 948 would fit"),
    (f"{SCENE} --thickness 60", "--thickness = 60.0 mm: give a finite number, less than 48"),
    (f"{SCENE} --deviation 30", "--deviation = 30.0 mm: give a finite number, at most 19.2"),
    (f"{SCENE} --deviation 0.001", "--deviation = 0.001 mm: give a finite number from 0.01"),
    (f"{SCENE} --out x.csv", "x.csv: name a .toml file"),
    (f"{SCENE} --slope 20", "the ground slopes by 20°"),
    (f"{SCENE} --gaps 30 5", "--gaps = 5.0 mm: give a finite number, at least 30, less than 48"),
])  # fmt: skip
def test_an_error_is_one_line(error_of, monkeypatch, file, words, message):
    monkeypatch.chdir(file.parent)
    texts = {
        "empty.csv": "",
        "one.csv": "spacing_mm,thickness_mm\n,7.5\n",
        "mm.csv": "spacing,thickness\n18,7.5\n,7.5\n",
    }
    for name, text in texts.items():
        Path(name).write_text(text)
    assert message in error_of(*words.split())
    assert sorted(path.name for path in file.parent.iterdir()) == sorted([file.name, *texts])


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize(
    "becomes", [KeyboardInterrupt, ValueError, TypeError, ImportError("failed"), None]
)
def test_an_interruption_is_reported_whatever_a_library_raises(
    capsys, monkeypatch, file, number, code, becomes
):
    """NumPy turns a KeyboardInterrupt during a comparison into another exception.

    A search or a training catches it and ends with the best so far: no exception is raised.
    """

    def interrupted(arguments: object) -> int:
        try:
            signal.raise_signal(number)
        except KeyboardInterrupt:
            if becomes is not None:
                raise becomes from None
        return 0

    monkeypatch.setattr("domino_env.cli.simulate.run", interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert main(["simulate", str(file)]) == code
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr().err.startswith("domino: interrupted" if becomes else "")


def test_the_installed_program_runs(file):
    program = Path(sys.executable).with_name("domino")
    assert program.exists(), "install the package: make test does"
    done = subprocess.run([program, "--help"], capture_output=True, text=True, check=True)
    assert "simulate" in done.stdout
    assert "optimize" in done.stdout
    module = [sys.executable, "-m", "domino_env", "simulate", "nothing.csv"]
    done = subprocess.run(module, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert "Traceback" not in done.stderr


def test_the_help_has_groups_of_commands(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["--help"])
    text = capsys.readouterr().out
    groups = [line for line in text.splitlines() if line.endswith(":") and line != "options:"]
    assert groups == ["simulate:", "search:", "learn:", "build and look:", "validate:"]


def test_ctrl_c_while_modules_are_imported_prints_no_traceback():
    code = """if True:
        import os, signal, sys, _domino_command
        class Finder:
            def find_spec(self, name, *_):
                if name == "domino_env.core.progress":
                    os.kill(os.getpid(), signal.SIGINT)
        sys.meta_path.insert(0, Finder())
        _domino_command.main()
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")


def test_an_interrupted_command_does_not_wait_for_its_threads():
    code = """if True:
        import sys, threading, time, _domino_command, domino_env.cli.main as command
        def interrupted():
            threading.Thread(target=time.sleep, args=(60.0,)).start()
            print("best so far")
            return 130
        command.main = interrupted
        sys.exit(_domino_command.main())
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=50)
    assert (done.returncode, done.stdout) == (130, "best so far\n")


def test_a_closed_output_pipe_ends_the_command_without_a_message(file, tmp_path):
    de.Layout.uniform(3000, pitch=0.024).to_csv(tmp_path / "long.csv")  # more than a pipe holds
    program = [sys.executable, "-m", "domino_env", "simulate", str(tmp_path / "long.csv"), "--json"]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(program, text=True, **streams) as running:
        running.stdout.readline()
        running.stdout.close()
        lines = running.stderr.read().splitlines()
        assert [line for line in lines if not line.startswith("compiling")] == []
        assert running.wait() == 141


def test_notices_are_printed_only_while_a_command_runs(capsys, monkeypatch, file):
    def run(_: object) -> int:
        with tqdm(total=2, desc="search") as bar:
            bar.update()
            notice("compiling ...")
        return 0

    monkeypatch.setattr("domino_env.cli.simulate.run", run)
    assert main(["simulate", str(file)]) == 0
    notice("no command is running")
    lines = capsys.readouterr().err.replace("\r", "\n").splitlines()
    assert "compiling ..." in lines  # not within the line of the bar
    assert "no command is running" not in lines


@pytest.mark.parametrize("closed", [["stderr"], ["stdout"], ["stdout", "stderr"]], ids=str)
def test_a_command_without_its_streams_runs(capsys, monkeypatch, tmp_path, file, closed):
    """Services have none, and `pythonw` neither."""
    for name in closed:
        monkeypatch.setattr(sys, name, None)
    words = ["optimize", "sprint", "--budget", "20", "--out", str(tmp_path / "run")]
    commands = words, [*words, "--resume"], ["simulate", "none.csv"], ["simulate", str(file)]
    assert [main(command) for command in commands] == [0, 0, 2, 0]
    for name in closed:
        getattr(sys, name).close()
    printed = capsys.readouterr()
    assert ("none.csv" in printed.err) == ("stderr" not in closed)
    assert ("best found" in printed.out) == ("stdout" not in closed)
    assert "none.csv" not in printed.out
