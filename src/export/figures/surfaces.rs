use std::ops::RangeInclusive;

use super::{
    canvas::{Anchor, Area, Canvas, Stroke},
    colour_bar::{COLOUR_BAR_WIDTH, draw_colour_bar},
    colours::{DIM, INK, MISSING, viridis},
    frame::Frame,
    picture::Picture,
    plot::Plot,
    plot_axis::{PlotAxis, share},
    relief::Relief,
    surface_panel::SurfacePanel,
};
use crate::surface::{Grid, Interpolation};

/// View of the surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurfaceLook {
    /// From above, as a map: the paper's Figs. 4 and 8.
    Top,
    /// In three dimensions, without perspective: the paper's Fig. 7.
    ThreeD,
}

/// Surfaces side by side with one scale of heights and colours. Only what lies between the nodes is drawn; beyond them
/// there are no data.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceFigure {
    /// Grid of the values.
    pub grid: Grid,
    /// Interpolation that gave the values, named below the surfaces.
    pub interpolation: Interpolation,
    /// The surfaces from left to right.
    pub panels: Vec<SurfacePanel>,
    /// Heights at the ends of the scale, in millimetres.
    pub range_mm: RangeInclusive<f64>,
    /// View of all surfaces.
    pub look: SurfaceLook,
}

impl SurfaceFigure {
    const HEIGHT: f64 = 240.0;
    /// Room below for the caption.
    const CAPTION: f64 = 14.0;
    /// Maximum number of cells per side: more would only make the file larger.
    const MOST_CELLS: usize = 64;

    /// Draws the figure, as wide as a page.
    pub fn draw(&self) -> Picture {
        let mut canvas = Canvas::new(Plot::WIDE_PT, Self::HEIGHT + Self::CAPTION);
        let width = (Plot::WIDE_PT - COLOUR_BAR_WIDTH - 8.0) / self.panels.len().max(1) as f64;
        let points = [
            thinned(self.grid.inside_x(), Self::MOST_CELLS),
            thinned(self.grid.inside_y(), Self::MOST_CELLS),
        ];
        for (at, panel) in self.panels.iter().enumerate() {
            let card = Area {
                left: width * at as f64,
                top: 20.0,
                width,
                height: Self::HEIGHT - 20.0,
            };
            match self.look {
                SurfaceLook::Top => self.draw_map(&mut canvas, card, panel, &points),
                SurfaceLook::ThreeD => {
                    canvas.title([card.centre()[0], 11.0], &panel.title);
                    let [x, y] = self.sides(&points);
                    let relief = Relief::new(card, &x, &y, &self.range_mm);
                    relief.draw_box(&mut canvas, "z (mm)");
                    relief.draw_surface(&mut canvas, &self.grid, &points, panel, &self.range_mm);
                }
            }
        }
        let left = Plot::WIDE_PT - COLOUR_BAR_WIDTH;
        let axis = PlotAxis::linear("z (mm)");
        draw_colour_bar(&mut canvas, left, 28.0, Self::HEIGHT - 64.0, &axis, &self.range_mm);
        let caption = format!("Between the nodes: {}.", self.interpolation);
        let place = [12.0, Self::HEIGHT + 0.4 * Self::CAPTION];
        canvas.text(place, Anchor::Start, DIM, &caption);
        canvas.finish()
    }

    /// From the first to the last node along x and y, in millimetres.
    fn sides(&self, [columns, rows]: &[Vec<usize>; 2]) -> [RangeInclusive<f64>; 2] {
        let side = |points: &[usize], mm: &[f64]| mm[points[0]]..=mm[points[points.len() - 1]];
        [side(columns, self.grid.x_mm()), side(rows, self.grid.y_mm())]
    }

    fn draw_map(&self, canvas: &mut Canvas, card: Area, panel: &SurfacePanel, points: &[Vec<usize>; 2]) {
        let [x, y] = self.sides(points);
        let [x_axis, y_axis] = ["x (mm)", "y (mm)"].map(PlotAxis::linear);
        // True to scale, as far as the card allows.
        let room = Area {
            left: card.left + 50.0,
            top: card.top + 8.0,
            width: card.width - 62.0,
            height: card.height - 44.0,
        };
        let [across, up] = [&x, &y].map(|side| side.end() - side.start());
        let scale = (room.width / across).min(room.height / up);
        let width = (across * scale).max(0.6 * room.width).min(room.width);
        let height = (up * scale).max(0.5 * room.height).min(room.height);
        let area = Area {
            left: room.left + 0.5 * (room.width - width),
            width,
            height,
            ..room
        };
        let frame = Frame {
            area,
            x: (&x_axis, x),
            y: (&y_axis, y),
        };
        canvas.title([area.centre()[0], 11.0], &panel.title);
        frame.draw(canvas);
        let [columns, rows] = points;
        canvas.clipped(area, |canvas| {
            for ix in columns.windows(2) {
                for iy in rows.windows(2).rev() {
                    let corners = [(ix[0], iy[0]), (ix[1], iy[0]), (ix[0], iy[1]), (ix[1], iy[1])];
                    let sum: f64 = corners
                        .iter()
                        .map(|&(ix, iy)| panel.values_mm[self.grid.index(ix, iy)])
                        .sum();
                    let colour = if sum.is_finite() {
                        viridis(share(0.25 * sum, &self.range_mm))
                    } else {
                        MISSING
                    };
                    let [left, right] = [ix[0], ix[1]].map(|ix| frame.x_at(self.grid.x_mm()[ix]));
                    let [bottom, top] = [iy[0], iy[1]].map(|iy| frame.y_at(self.grid.y_mm()[iy]));
                    let cell = Area {
                        left,
                        top,
                        width: right - left,
                        height: bottom - top,
                    };
                    canvas.block(cell, colour);
                }
            }
        });
        let edge = Stroke::new(INK, 0.5);
        for node in &panel.nodes_mm {
            if let Some(at) = frame.at(node.x, node.y) {
                canvas.disc(at, 1.0, [255; 3], Some(edge));
            }
        }
    }
}

/// Thins `indices` to at most `most` cells between the first and the last one.
fn thinned(indices: RangeInclusive<usize>, most: usize) -> Vec<usize> {
    let (first, last) = indices.into_inner();
    let stride = (last - first).div_ceil(most).max(1);
    (first..last).step_by(stride).chain([last]).collect()
}
