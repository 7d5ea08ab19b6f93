"""The connection to a Dask cluster."""

import logging
from collections.abc import Callable
from typing import Any

from raytracer.rendering.cluster.executor import ClusterExecutor
from raytracer.rendering.options import RenderOptions
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError

WAIT_SECONDS = 60.0
"""Seconds that a render waits for the first worker."""

CONNECT_SECONDS = 10.0


class Cluster:
    """A Dask cluster that renders in place of this machine: for `render(..., cluster=...)`.

    It may be used by several threads at once, and for any number of renders.  Use it in a `with` statement, or close
    it.

    Parameters
    ----------
    address : of the scheduler, "tcp://host:8786" or "tls://host:8786"; or a `distributed.Client`, or one of Dask's own
        clusters, such as `dask_jobqueue.SLURMCluster`.
    patience (s) : time that a render waits for the first worker.
    say : called with a sentence about what takes long.

    Raises
    ------
    InputError : there is no scheduler, or Dask is not installed.
    """

    def __init__(
        self, address: Any, *, patience: float = WAIT_SECONDS, say: Callable[[str], object] | None = None
    ) -> None:
        require_dask()
        from distributed import Client

        self._patience = patience
        self._say = say or (lambda sentence: None)
        self._is_own = not isinstance(address, Client)
        self.client: Any = address if isinstance(address, Client) else _connect_client(address)

    def __enter__(self) -> "Cluster":
        """Return the cluster, to be closed at the end of the `with` block."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the connection."""
        self.close()

    def close(self) -> None:
        """Disconnect from the scheduler, unless the client was given; jobs that are under way are forgotten."""
        if self._is_own:
            self.client.close()

    def connect(
        self, spec: SceneSpec, options: RenderOptions, warn: Callable[[str], object] | None = None
    ) -> ClusterExecutor:
        """Have the workers prepare a scene; see `worker_pool.ClusterClient`.

        Workers that cannot take part are found when samples are taken, so that all are asked meanwhile.
        """
        return ClusterExecutor(self.client, spec, options, warn, self._patience, self._say)


def require_dask() -> None:
    """Check that Dask is installed.

    Raises
    ------
    InputError : it is not.
    """
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError(
            "rendering on a cluster needs Dask's distributed: pip install 'raytracer[cluster]', here and on the cluster"
        ) from None


def _connect_client(address: Any) -> Any:
    import dask
    import distributed

    # Typed in part.
    dask_client: Any = distributed.Client
    security: Any = distributed.Security
    if str(address).startswith("tls://") and security().get_connection_args("client")["ssl_context"] is None:
        raise InputError(f"{address}: needs certificates, which Dask's settings are to name under distributed.comm.tls")
    # The files of a scene are sent as they are, of which Dask would warn.
    dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 TB"})
    # What it says when the scheduler is gone is said in rt's own words.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        return dask_client(address, timeout=CONNECT_SECONDS, name="rt", set_as_default=False)
    except (OSError, TimeoutError) as error:
        reason = f"no Dask scheduler answers within {CONNECT_SECONDS:g} s"
        if not isinstance(error, TimeoutError) and "imed out" not in str(error):
            reason = f"the Dask scheduler cannot be reached: {error}"
        raise InputError(f"{address}: {reason}; `dask scheduler` starts one, and says its address") from None
    except ValueError as error:
        raise InputError(f"{address}: is no address of a Dask scheduler, such as tcp://host:8786: {error}") from None
