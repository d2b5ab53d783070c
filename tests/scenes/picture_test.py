"""Pictures of the program islet: the PNG shows what the SVG says. picture_test.py ISLET"""
import os
import re
import struct
import subprocess
import tempfile
import unittest
import zlib

from program import ISLET


def pixels(data):
    """Rows of (red, green, blue) of a PNG of 8 bits a channel without interlace."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, packed = 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + length]
        assert zlib.crc32(kind + body) == struct.unpack(">I", data[at + 8 + length:at + 12 + length])[0]
        if kind == b"IHDR":
            width, height, depth, colour, _, _, interlace = struct.unpack(">IIBBBBB", body)
            assert (depth, interlace) == (8, 0)
        elif kind == b"IDAT":
            packed += body
        at += 12 + length
    channels = {2: 3, 6: 4}[colour]
    raw, stride, rows, before = zlib.decompress(packed), width * channels, [], bytearray(width * channels)
    for y in range(height):
        kind, line = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        for i in range(stride):
            left = line[i - channels] if i >= channels else 0
            corner = before[i - channels] if i >= channels else 0
            up, guess = before[i], 0
            if kind == 1:
                guess = left
            elif kind == 2:
                guess = up
            elif kind == 3:
                guess = (left + up) // 2
            elif kind == 4:
                p = left + up - corner
                guess = min((abs(p - left), 0, left), (abs(p - up), 1, up), (abs(p - corner), 2, corner))[2]
            line[i] = line[i] + guess & 255
        rows.append([tuple(line[i:i + 3]) for i in range(0, stride, channels)])
        before = line
    return rows


def rgb(text):
    return tuple(int(text[i:i + 2], 16) for i in (1, 3, 5))


class Pictures(unittest.TestCase):
    def draw(self, *arguments):
        with tempfile.TemporaryDirectory() as folder:
            texts = []
            for name in "p.svg", "p.png":
                path = os.path.join(folder, name)
                subprocess.run([ISLET, "run", *arguments, "--picture", path], check=True, capture_output=True)
                with open(path, "rb") as file:
                    texts.append(file.read())
        return texts[0].decode(), pixels(texts[1])

    def near(self, pixel, wanted, what):
        self.assertLessEqual(max(abs(a - b) for a, b in zip(pixel, wanted)), 3, (what, pixel, wanted))

    def check_frame(self, svg, rows):
        width, height = map(int, re.search(r'viewBox="0 0 (\d+) (\d+)"', svg).groups())
        self.assertEqual((len(rows[0]), len(rows)), (width, height))
        for x, y in (0, 0), (width - 1, 0):
            self.near(rows[y][x], (0xFB, 0xFA, 0xF7), "paper")

    def test_polygons(self):
        svg, rows = self.draw("stack", "--count", "4", "--frames", "2")
        self.check_frame(svg, rows)
        faces = re.findall(r'<path d="M([^Z]*)Z" fill="(#\w+)"/>', svg)
        self.assertGreaterEqual(len(faces), 12)
        for outline, fill in faces[-3:]:  # of the cube that is painted last
            corners = [tuple(map(float, corner.split())) for corner in outline.split("L")]
            x, y = (round(sum(values) / len(corners)) for values in zip(*corners))
            self.near(rows[y][x], rgb(fill), outline)

    def test_balls(self):
        svg, rows = self.draw("officetoy", "--frames", "1")
        self.check_frame(svg, rows)
        x, y, r, name = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)" r="([\d.]+)" fill="url\(#(\w+)\)"/>', svg)[-1]
        x, y, r = float(x), float(y), float(r)
        bright, middle = (rgb(c) for c in re.search(rf'id="{name}".*?"0" stop-color="(#\w+)".*?".55" stop-color="(#\w+)"',
                                                    svg).groups())
        self.near(rows[round(y - 0.4 * r)][round(x - 0.28 * r)], bright, "where the light falls")
        # 0.55 of the gradient's radius of 1.5 r to the right of that
        self.near(rows[round(y - 0.4 * r)][round(x - 0.28 * r + 0.55 * 1.5 * r)], middle, "further")


if __name__ == "__main__":
    unittest.main()
