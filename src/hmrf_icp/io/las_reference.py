"""What a LAS file says of its coordinates: degrees and feet are no metres."""

from __future__ import annotations

import re
from typing import Any

_MODEL, _GEOGRAPHIC = 1024, 2
"""GeoTIFF's key of the kind of coordinates, and its value for longitude and latitude."""

_UNIT, _FEET = 3076, (9002, 9003)
"""GeoTIFF's key of the unit of length, and its values for the two feet."""


def doubts(header: Any) -> tuple[str, ...]:
    """Return a sentence where the reference system is one of degrees or of feet.

    Nothing is converted: the unit of the result is that of the file.

    Parameters
    ----------
    header
        Of laspy.
    """
    degrees = feet = False
    for record in header.vlrs:
        text = getattr(record, "string", None)
        if isinstance(text, str) and record.user_id == "LASF_Projection":
            degrees |= text.lstrip().upper().startswith(("GEOGCS", "GEOGCRS"))
            # The last unit of length is that of the projection.
            feet |= bool(re.search(r"(?:LENGTH)?UNIT\[\"[^\"]*f(?:oo|ee)t", text, re.I))
        for key in getattr(record, "geo_keys", ()):
            degrees |= (key.id, key.value_offset) == (_MODEL, _GEOGRAPHIC)
            feet |= key.id == _UNIT and key.value_offset in _FEET
    if degrees:
        return (
            "coordinates in degrees of longitude and latitude, says the file, and taken for "
            "lengths: project them first",
        )
    if feet:
        return ("coordinates in feet, says the file: so are all lengths of the result",)
    return ()
