"""Pictures as PNG, drawn by Pillow."""

from __future__ import annotations

from io import BytesIO

from diffbotctl.ui.figure import SIZE, Figure, Line

FINER = 2  # pixels of the file for one of the picture, so that lines are smooth
ANCHORS = {"start": "ls", "middle": "ms", "end": "rs"}  # Pillow's words; s is the base line


def encode(picture: Figure) -> bytes:
    """The picture as a PNG file. Raises ImportError without Pillow."""
    from PIL import Image, ImageDraw, ImageFont

    image = Image.new("RGB", (picture.width * FINER, picture.height * FINER), "white")
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(SIZE * FINER)
    for shape in picture.shapes:
        if isinstance(shape, Line):
            points = [(x * FINER, y * FINER) for x, y in shape.points]
            draw.line(points, shape.colour, round(shape.width * FINER), joint="curve")
        else:
            place = (shape.x * FINER, shape.y * FINER)
            draw.text(place, shape.text, shape.colour, font, anchor=ANCHORS[shape.anchor])
    file = BytesIO()
    image.save(file, "PNG")
    return file.getvalue()
