#!/bin/bash
# Makes the recordings of this folder anew, in about a minute. Needs diffbotctl in PATH, and the
# root of the repository in PYTHONPATH.
set -u
cd "$(dirname "$0")"
scratch=$(mktemp -d)
export XDG_RUNTIME_DIR=$scratch XDG_STATE_HOME=$scratch
trap 'rm -r "$scratch"' EXIT

record() { # NAME WORDS: `diffbotctl run WORDS` to NAME.mcap
    local name=$1
    shift
    rm -f "$name.mcap"
    diffbotctl run "$@" --quiet --record "$name.mcap"
}

started() { # waits for the control socket of the engine NAME
    until diffbotctl topic list --engine "$1" >/dev/null 2>&1; do sleep 0.1; done
}

record edges goal --robot book_2wd --goal '0.15 0.1 40deg' --seed 11 --fast --no-socket
record counts goal --robot book_2wd_counts --goal '0.06 0' --seed 12 --fast --no-socket
record emulated goal --robot book_2wd --port emulated --goal '0.2 -0.1' --seed 14 --fast --no-socket
record path path.yaml --set 'vars.step=8 cm' --set 'robot.limits.speed=0.12 m/s' --seed 15 --fast --for 4s \
    --set 'robot.battery={pin: A1, full: 7.4 V, divider: 3, low: 6 V}' --no-socket
record wander wander --set 'world.obstacles=[{at: [0.55 m, 0.02 m], radius: 15 cm}]' --seed 16 \
    --fast --for 1.9s --no-socket
record turtles turtles --for 1s --seed 22 --fast --no-socket
record hello hello --for 2s --fast --no-socket

record turtle turtle --name turtle --set 'robot.board.telemetry=20 Hz' --seed 17 --for 10s &
started turtle
diffbotctl param set --engine turtle canvas.background_red 200
diffbotctl param set --engine turtle canvas.pen up
diffbotctl call --engine turtle canvas.spawn x=2 y=3 heading=90deg
diffbotctl call --engine turtle robot.teleport x=3 y=3
diffbotctl log level --engine turtle canvas debug
diffbotctl drive --engine turtle --v 1 --w 1 --for 0.4s
diffbotctl goto --engine turtle 3.4 3.2
wait

record obstacle goal --robot book_2wd_stock --name wall --goal '0.6 0' --seed 18 --for 9s \
    --set 'world.walls=[{from: [0.22 m, -1 m], to: [0.22 m, 1 m]}]' --set guard.resume=wait &
started wall
sleep 1.5
diffbotctl drive --engine wall --v -0.2 --for 1s
diffbotctl resume --engine wall
wait

# A user's own block, of a package that is installed.
mkdir -p "$scratch/easy-1.0.dist-info"
printf 'Metadata-Version: 2.1\nName: easy\nVersion: 1.0\n' >"$scratch/easy-1.0.dist-info/METADATA"
printf '[diffbotctl.blocks]\nease = tests.test_recordings:Ease\n' \
    >"$scratch/easy-1.0.dist-info/entry_points.txt"
PYTHONPATH=$scratch:$PYTHONPATH record ease ease.yaml --name ease --goal '0.4 0.2' --seed 19 --stay --for 9s &
started ease
diffbotctl param set --engine ease ease.share 40%
diffbotctl param set --engine ease ease.rounds 3
diffbotctl param set --engine ease ease.mode turns
diffbotctl call --engine ease ease.press factor=0.7
diffbotctl call --engine ease ease.press factor=2 # refused
diffbotctl param set --engine ease guard.margin 8cm
wait

# The book's board, and one with this firmware, on serial ports: with times as they came.
python - <<'END'
import subprocess
from tests.support.book_board import BookBoardPort

port = BookBoardPort()
words = ["--port", port.name, "--robot", "book_2wd_stock", "--goal", "0.15 0.05", "--no-socket"]
subprocess.call(["diffbotctl", "run", "goal", *words, "--quiet", "--record", "stock.mcap"])
port.close()
END

diffbotctl emulate book_2wd --seed 20 >"$scratch/board" &
board=$!
until grep -q '/dev/\|/tty' "$scratch/board"; do sleep 0.1; done
port=$(grep -o '/[^ ]*tty[^ ]*' "$scratch/board" | head -1)
record operator goal --robot book_2wd --name held --port "$port" --goal '0.2 0' --for 6s &
run=$!
started held
diffbotctl stop --engine held 'a person in the way'
diffbotctl resume --engine held
wait $run
kill -INT $board
wait
