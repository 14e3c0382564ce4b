"""Report as a PDF file of A4 pages, drawn with matplotlib."""
import textwrap

import matplotlib

from ros_3d_bb_lab.evaluation.report_blocks import Figure, Heading, Paragraph

matplotlib.use('Agg')  # works without a display
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.backends.backend_pdf import PdfPages  # noqa: E402

WIDTH_IN, HEIGHT_IN, MARGIN_IN = 8.27, 11.69, 0.8
TEXT_PT, SMALL_PT, HEADING_PT, TITLE_PT = 9, 8, 13, 18
LINE = 1.45  # relative to the size of the text
CHARACTER, CELL_CHARACTER = 0.50, 0.60  # mean width of characters in text, and in short cells, relative to height
POINTS = 72.0
LARGEST_FIGURE_IN = 4.6


def pdf_report(path, title, blocks, folder):
    """Write blocks to a PDF file (pathlib.Path). Figures are read from a folder."""
    with PdfPages(str(path), metadata={'Title': title}) as pages:
        writer = _Writer(pages)
        writer.write(title, TITLE_PT, weight='bold')
        for block in blocks:
            if isinstance(block, Heading):
                writer.keep(1.2)
                writer.skip(0.15)
                writer.write(block.text, HEADING_PT, weight='bold')
            elif isinstance(block, Paragraph):
                writer.write(block.text)
                writer.skip(0.08)
            elif isinstance(block, Figure):
                writer.draw(folder / block.name, block.caption)
            else:
                writer.tabulate(block)
        writer.finish()


class _Writer(object):
    """Fills pages from top to bottom; lengths are in inches."""

    def __init__(self, pages):
        self._pages, self._number, self._figure, self._y_in = pages, 0, None, 0.0
        self._start()

    def keep(self, height_in):
        """Start a new page if less than a height is left."""
        if self._y_in - height_in < MARGIN_IN:
            self.finish()
            self._start()

    def skip(self, height_in):
        self._y_in -= height_in

    def write(self, text, size_pt=TEXT_PT, **style):
        """Write a paragraph."""
        width = int((WIDTH_IN - 2 * MARGIN_IN) * POINTS / (CHARACTER * size_pt))
        for line in textwrap.wrap(text, width):
            self.keep(size_pt * LINE / POINTS)
            self._put(line, MARGIN_IN, size_pt, **style)
            self.skip(size_pt * LINE / POINTS)

    def draw(self, path, caption):
        """Draw an image with its caption below."""
        pixels = plt.imread(str(path))
        height, width = pixels.shape[:2]
        scale = min((WIDTH_IN - 2 * MARGIN_IN) / width, LARGEST_FIGURE_IN / height)
        self.keep(height * scale + 0.5)
        self.skip(height * scale)
        axes = self._figure.add_axes([MARGIN_IN / WIDTH_IN, self._y_in / HEIGHT_IN, width * scale / WIDTH_IN,
                                      height * scale / HEIGHT_IN])
        axes.imshow(pixels, interpolation='none')
        axes.axis('off')
        self.skip(0.16)
        self.write(caption, SMALL_PT, color='0.3')
        self.skip(0.12)

    def tabulate(self, table):
        """Write a table with its caption above. Cells of the last column are wrapped."""
        columns = list(zip(table.header, *table.rows))
        widths = [max(map(len, cells)) + 2 for cells in columns]
        full = (WIDTH_IN - 2 * MARGIN_IN) * POINTS / CELL_CHARACTER
        last = max(20, int(full / SMALL_PT) - sum(widths[:-1]))
        size_pt = min(SMALL_PT, full / (sum(widths[:-1]) + min(widths[-1], last)))
        height_in = size_pt * LINE / POINTS * (len(table.rows) + 2)
        self.keep(height_in if height_in < HEIGHT_IN / 3 else 0.8)
        self.write(table.caption, SMALL_PT, color='0.3')
        for number, row in enumerate((table.header,) + tuple(table.rows)):
            wrapped = textwrap.wrap(row[-1], last) or ['']
            self.keep(size_pt * LINE / POINTS * len(wrapped))
            x_in = MARGIN_IN
            for cell, width in zip(row[:-1], widths):
                self._put(cell, x_in, size_pt, weight='bold' if number == 0 else 'normal')
                x_in += width * CELL_CHARACTER * size_pt / POINTS
            for line in wrapped:
                self._put(line, x_in, size_pt, weight='bold' if number == 0 else 'normal')
                self.skip(size_pt * LINE / POINTS)
        self.skip(0.15)

    def finish(self):
        """Complete the page."""
        self._figure.text(0.5, 0.4 / HEIGHT_IN, str(self._number), size=SMALL_PT, ha='center')
        self._pages.savefig(self._figure)
        plt.close(self._figure)

    def _start(self):
        self._figure, self._y_in = plt.figure(figsize=(WIDTH_IN, HEIGHT_IN)), HEIGHT_IN - MARGIN_IN
        self._number += 1

    def _put(self, text, x_in, size_pt, **style):
        # "$" would start a formula
        self._figure.text(x_in / WIDTH_IN, self._y_in / HEIGHT_IN, text.replace('$', r'\$'), size=size_pt, va='top',
                          **style)
