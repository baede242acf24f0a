"""The book's firmware over a socket: its board cannot stop by itself, so the guardian must."""

import os
import select
import socket
from contextlib import suppress

from tests.support.background import BackgroundDevice
from tests.support.book_board import BookBoard, BookBoardPort
from tests.support.virtual_board import run, start


class Relay(BackgroundDevice):
    """A radio without any delay: a socket joined to a board's port."""

    def __init__(self, port, path):
        self.device = f"socket:{path}"
        self.board = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self.server = socket.socket(socket.AF_UNIX)
        self.server.bind(str(path))
        self.server.listen(1)
        self.begin()

    def let_go(self):
        self.server.close()
        os.close(self.board)

    def live(self):
        host = None
        while not self.over.is_set():
            ends = [self.board, host or self.server]
            for end in select.select(ends, [], [], 0.02)[0]:
                if end is self.server:
                    host, _ = self.server.accept()
                elif end is host:
                    output = b""
                    with suppress(ConnectionResetError):  # who was killed leaves so
                        output = host.recv(4096)
                    os.write(self.board, output)
                    if not output:
                        host.close()
                        host = None
                else:
                    data = os.read(self.board, 4096)
                    with suppress(OSError):
                        if host is not None:
                            host.send(data)
        if host is not None:
            host.close()


def drive(relay):
    words = run(relay.device, "--goal", "30 0", "--set", "robot.drive.polarity=checked_by_hand")
    return start(*(word if word != "book_2wd" else "book_2wd_stock" for word in words))


def test_the_guardian_stops_a_board_whose_host_was_killed(tmp_path):
    stock = BookBoardPort(BookBoard(distance=25.0))
    with Relay(stock.name, tmp_path / "radio") as relay:
        driver = drive(relay)
        stock.wait_for(lambda board: board.speed["left"] > 3, 60)
        driver.kill()
        driver.communicate()
        stock.wait_for(lambda board: board.pwm == {"left": 0, "right": 0}, 60)
    stock.close()


def test_an_ended_run_hangs_up_and_the_next_one_drives(tmp_path):
    stock = BookBoardPort(BookBoard(distance=25.0))
    with Relay(stock.name, tmp_path / "radio") as relay:
        for _ in range(2):
            driver = drive(relay)
            stock.wait_for(lambda board: board.speed["left"] > 3, 60)
            driver.terminate()
            output, _ = driver.communicate(timeout=60)
            assert "final stop confirmed" in output
            assert stock.board.pwm == {"left": 0, "right": 0}
    stock.close()
