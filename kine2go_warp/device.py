"""Which device to use, chosen once for Warp and torch."""

from kine2go_warp.errors import Kine2GoError


def choose_device(name: str | None) -> str:
    """Return the device to use: the one named, or CUDA where there is one, else the CPU.

    Warp is told to be quiet, since the command line reports progress itself.

    Raises:
        Kine2GoError: the named device does not exist here.
    """
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    wp.init()
    known = [device.alias for device in wp.get_devices()]
    if name is None:
        return "cuda:0" if wp.is_cuda_available() else "cpu"
    name = "cuda:0" if name == "cuda" else name
    if name not in known:
        raise Kine2GoError(f"no device '{name}' on this machine; there is: {', '.join(known)}")
    return name
