import os
import signal
import threading

import pytest

from kine2go_warp.interruption import StopRequest


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_asks_and_the_second_stops(number, capfd):
    earlier = signal.getsignal(number)
    with StopRequest("stopping soon") as stop:
        assert not stop()
        os.kill(os.getpid(), number)
        assert stop()
        assert capfd.readouterr().err == "\nkine2go: stopping soon\n"
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)
    assert signal.getsignal(number) is earlier


def test_in_another_thread_it_handles_no_signals_and_stops_nothing():
    seen = []

    def work():
        with StopRequest() as stop:
            seen.append(stop())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [False]
