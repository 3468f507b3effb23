"""Rows on their way to a disk that is slow, or full, or broken."""

import threading
import time

import numpy as np
import pytest
import torch

from kine2go_warp.rollouts import row_writer
from kine2go_warp.rollouts.row_writer import QUEUED_BLOCKS, AsyncRowWriter

WORLDS = 3


def block(first, rows):
    """Rows that know their own number, of several types and shapes."""
    number = torch.arange(first, first + rows)
    return {
        "position": (number[:, None, None] + torch.arange(WORLDS)[:, None] / 10 + torch.arange(2) / 100).float(),
        "phase": number[:, None].expand(rows, WORLDS).double(),
        "cycle": number[:, None].expand(rows, WORLDS).int(),
    }


class SlowDisk:
    """Lets a block through only when told to, and counts."""

    def __init__(self, monkeypatch, error=None):
        self.permits, self.written, self.error = threading.Semaphore(0), 0, error
        write_block = AsyncRowWriter._write_block

        def wait_and_write(writer, *arguments):
            self.permits.acquire()
            if self.error is not None:
                raise self.error
            write_block(writer, *arguments)
            self.written += 1

        monkeypatch.setattr(AsyncRowWriter, "_write_block", wait_and_write)


@pytest.fixture
def full_disk(monkeypatch):
    """A disk that fails at the first block, as soon as it is let."""
    return SlowDisk(monkeypatch, OSError(28, "No space left on device"))


def within(seconds, action):
    """Runs something in a thread; it must end in time. Returns what it raised."""
    raised = []

    def run():
        try:
            action()
        except Exception as error:  # noqa: BLE001 - handed to the test
            raised.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(seconds)
    assert not thread.is_alive(), "it hangs"
    return raised[0] if raised else None


def test_rows_come_back_in_order_with_their_type_by_world(tmp_path):
    with AsyncRowWriter(tmp_path / "rows") as writer:
        sizes = (5, 1, 7, 2)
        for first, rows in zip(np.cumsum((0, *sizes)), sizes, strict=False):
            writer.submit(block(int(first), rows), None)
        writer.close()
        expected = block(0, sum(sizes))
        assert set(writer.names) == set(expected)
        assert writer.num_bytes == sum(values.numpy().nbytes for values in expected.values())
        for name, values in expected.items():
            rows = writer.read(name, np.array([2, 0]))
            assert rows.dtype == values.numpy().dtype, name
            np.testing.assert_array_equal(rows, np.moveaxis(values.numpy()[:, [2, 0]], 0, 1))


def test_rows_that_are_not_contiguous_are_written_as_they_read(tmp_path):
    values = torch.arange(24.0).reshape(2, WORLDS, 4).transpose(0, 1)[:, :, ::2]
    with AsyncRowWriter(tmp_path / "rows") as writer:
        writer.submit({"values": values}, None)
        writer.close()
        np.testing.assert_array_equal(writer.read("values", np.arange(2)), np.moveaxis(values.numpy(), 0, 1))


def test_what_an_earlier_run_left_in_the_folder_is_not_read(tmp_path):
    (tmp_path / "rows").mkdir()
    (tmp_path / "rows" / "stale").write_bytes(b"old")
    AsyncRowWriter(tmp_path / "rows").close()
    assert list((tmp_path / "rows").iterdir()) == []


def test_a_slow_disk_makes_the_simulation_wait_so_that_memory_is_bounded(tmp_path, monkeypatch):
    disk = SlowDisk(monkeypatch)
    submitted = []
    with AsyncRowWriter(tmp_path / "rows") as writer:

        def simulate():
            for number in range(10):
                writer.submit(block(number, 1), None)
                submitted.append(number)

        simulation = threading.Thread(target=simulate, daemon=True)
        simulation.start()
        for done in range(4):
            # One block is being written, QUEUED_BLOCKS wait, the next is not taken.
            deadline = time.monotonic() + 5.0
            while len(submitted) < done + 1 + QUEUED_BLOCKS and time.monotonic() < deadline:
                time.sleep(0.001)
            time.sleep(0.02)
            assert len(submitted) == done + 1 + QUEUED_BLOCKS
            disk.permits.release()
        disk.permits.release(10)
        simulation.join(5.0)
        writer.close()
        assert disk.written == 10
        np.testing.assert_array_equal(writer.read("cycle", np.array([0]))[0], np.arange(10))


def test_the_time_for_which_the_simulation_waits_is_counted(tmp_path, monkeypatch):
    disk = SlowDisk(monkeypatch)
    with AsyncRowWriter(tmp_path / "rows") as writer:
        for number in range(QUEUED_BLOCKS):
            writer.submit(block(number, 1), None)
        assert writer.waited < 0.1, "there was room"
        threading.Timer(0.3, disk.permits.release, [QUEUED_BLOCKS]).start()
        writer.close()
        assert 0.25 < writer.waited < 2.0


def test_an_error_of_the_disk_reaches_the_next_submit_and_close(tmp_path, full_disk):
    with AsyncRowWriter(tmp_path / "rows") as writer:
        writer.submit(block(0, 1), None)
        full_disk.permits.release(100)
        error = within(5.0, lambda: [(writer.submit(block(1, 1), None), time.sleep(0.01)) for _ in range(100)])
        assert isinstance(error, OSError)
        assert error.errno == 28
        assert isinstance(within(5.0, writer.close), OSError)


def test_an_error_frees_a_simulation_that_waits_for_a_full_queue(tmp_path, full_disk):
    with AsyncRowWriter(tmp_path / "rows") as writer:
        for number in range(QUEUED_BLOCKS + 1):
            within(5.0, lambda number=number: writer.submit(block(number, 1), None))
        threading.Timer(0.1, full_disk.permits.release, [100]).start()
        within(5.0, lambda: writer.submit(block(9, 1), None))
        assert isinstance(within(5.0, writer.close), OSError)


def test_a_file_that_cannot_be_opened_is_an_error_too_and_not_a_hang(tmp_path):
    with AsyncRowWriter(tmp_path / "rows") as writer:
        (tmp_path / "rows" / "phase").mkdir()
        error = within(5.0, lambda: [writer.submit(block(number, 1), None) for number in range(50)] and writer.close())
        assert isinstance(error, IsADirectoryError)


def test_an_error_that_is_not_the_disks_reaches_the_caller(tmp_path):
    class BrokenDevice:
        def synchronize(self):
            raise RuntimeError("the device is lost")

    with AsyncRowWriter(tmp_path / "rows") as writer:
        writer.submit(block(0, 1), BrokenDevice())
        error = within(5.0, writer.close)
        assert isinstance(error, RuntimeError)
        assert "the device is lost" in str(error)


def test_rows_are_taken_only_when_the_device_has_them(tmp_path):
    values = torch.zeros(1, WORLDS)

    class Copy:
        def synchronize(self):
            values.fill_(7.0)

    with AsyncRowWriter(tmp_path / "rows") as writer:
        writer.submit({"values": values}, Copy())
        writer.close()
        np.testing.assert_array_equal(writer.read("values", np.arange(WORLDS)), 7.0)


def test_a_simulation_that_fails_ends_the_thread_without_writing_what_waits(tmp_path, monkeypatch):
    disk = SlowDisk(monkeypatch)
    writer = AsyncRowWriter(tmp_path / "rows")

    def fail():
        with writer:
            for number in range(QUEUED_BLOCKS):
                writer.submit(block(number, 1), None)
            threading.Timer(0.1, disk.permits.release, [100]).start()
            raise ValueError("the simulation has failed")

    assert isinstance(within(5.0, fail), ValueError)
    assert not writer._thread.is_alive()
    assert disk.written <= 1


def test_as_many_blocks_wait_as_the_module_says(tmp_path):
    with AsyncRowWriter(tmp_path / "rows") as writer:
        assert writer._queue.maxsize == row_writer.QUEUED_BLOCKS
