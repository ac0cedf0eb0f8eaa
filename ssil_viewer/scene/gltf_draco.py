"""KHR_draco_mesh_compression through the optional package DracoPy."""

from __future__ import annotations

import numpy as np

from ssil_viewer.scene.files import Malformed
from ssil_viewer.scene.gltf_document import Document, index_at, object_at


def decode_draco(document: Document, draco: dict) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Decodes a compressed primitive.

    Args:
        document: The asset.
        draco: The extension's object.

    Returns:
        (V, n) arrays by attribute name, and the (N,) indices of a triangle list.

    Raises:
        ImportError: DracoPy is not installed.
        Malformed: The data are broken.
    """
    import DracoPy  # optional, and slow to import

    data, _ = document.view(index_at(draco, "bufferView"))
    try:
        mesh = DracoPy.decode(bytes(data))
        faces = np.asarray(mesh.faces)
        by_id = {attribute["unique_id"]: np.asarray(attribute["data"]) for attribute in mesh.attributes}
    except Exception as error:  # the decoder has exceptions of its own
        raise Malformed(f"its Draco data are broken ({error})") from error
    attributes = {}
    for name in object_at(draco, "attributes"):
        values = by_id.get(index_at(draco["attributes"], name))
        if values is None:
            raise Malformed(f"its Draco data lack {name}")
        attributes[name] = values.reshape(len(values), -1)
    if "POSITION" not in attributes:
        raise Malformed("its Draco data have no positions")
    return attributes, faces.reshape(-1)
