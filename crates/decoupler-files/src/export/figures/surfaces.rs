//! Surfaces in print: the layout of the figure, written as SVG.

use std::sync::OnceLock;

use glam::Vec2;

use super::{
    canvas::{Anchor, Area, At, Canvas, Stroke, TEXT},
    picture::{DIM, GRID, INK, Picture, Rgb, rgb as hue_rgb},
    plot::PAGE_WIDTH,
};
use crate::figure::{
    ColourMap, Hue, SequentialMap,
    surface::{
        Bounds, Card, ColourScale, ContourLine, Disc, Drawing, Ink, Line, Mesh, Quantity, Surface, SurfaceFigure, Text,
    },
};

/// Font size for which surfaces are laid out, in points of the layout.
const TYPE_SIZE: f32 = 11.0;
/// Points of the canvas per point of the layout.
const SCALE: f64 = TEXT / TYPE_SIZE as f64;
/// Room for the title of a card, and for a line below the cards.
const TITLE: f64 = 16.0;
const LINE: f64 = 14.0;
/// Height of a card as a fraction of its width, and its limits in points.
const TALL_PER_WIDE: f64 = 0.98;
const HEIGHT: [f64; 2] = [150.0, 290.0];
const BAR_STEPS: usize = 64;

const EDGE: Rgb = [0xa2, 0xa9, 0xb4];
const WHITE: Rgb = [0xff; 3];

/// Draws surfaces side by side, as wide as a page. A colour bar is drawn to the right of the last card that it belongs
/// to.
pub(super) fn draw_surfaces(figure: &SurfaceFigure) -> Picture {
    let scales: Vec<ColourScale> = figure.surfaces.iter().map(Surface::scale).collect();
    let has_key = |card: usize| scales.get(card + 1) != Some(&scales[card]);
    let keys = (0..scales.len()).filter(|&card| has_key(card)).count();
    let key_width = f64::from(ColourScale::WIDTH) * SCALE;
    let width = (PAGE_WIDTH - keys as f64 * key_width) / scales.len().max(1) as f64;
    let height = (TALL_PER_WIDE * width).clamp(HEIGHT[0], HEIGHT[1]);
    let (mut left, mut notes) = (0.0, Vec::new());
    let mut pieces = Vec::new();
    for (card, surface) in figure.surfaces.iter().enumerate() {
        let drawing = surface.lay_out(
            figure.camera,
            &Card {
                bounds: layout(width, height),
                measure: &measure,
                colours: colours(&surface.quantity, surface.colours),
            },
        );
        notes.extend(drawing.note.clone().map(|note| (left, note)));
        pieces.push((left, surface, drawing));
        left += width + if has_key(card) { key_width } else { 0.0 };
    }
    let below = TITLE + height;
    let lines = if notes.is_empty() { 1.0 } else { 2.0 };
    let mut canvas = Canvas::new(PAGE_WIDTH, below + lines * LINE);
    for (card, (left, surface, drawing)) in pieces.iter().enumerate() {
        let area = Area {
            left: *left,
            top: TITLE,
            width,
            height,
        };
        canvas.title([area.centre()[0], 0.5 * TITLE + 2.0], &surface.title);
        canvas.clipped(area, |canvas| {
            Pen { canvas, area }.draw_surface(surface, drawing, figure);
        });
        if has_key(card) {
            let area = Area {
                left: area.right(),
                width: key_width,
                ..area
            };
            Pen {
                canvas: &mut canvas,
                area,
            }
            .draw_scale(&scales[card]);
        }
    }
    for (left, note) in notes {
        canvas.text(
            [left + 12.0, below + 0.5 * LINE],
            Anchor::Start,
            hue_rgb(Hue::Orange),
            &note,
        );
    }
    let place = [12.0, below + (lines - 0.5) * LINE];
    canvas.text(place, Anchor::Start, DIM, &figure.note());
    canvas.finish()
}

fn layout(width: f64, height: f64) -> Bounds {
    Bounds {
        min: Vec2::ZERO,
        max: Vec2::new((width / SCALE) as f32, (height / SCALE) as f32),
    }
}

/// Estimated size of a text, used to reserve room for it.
fn measure(text: &str) -> Vec2 {
    let width = |character: char| match character {
        '.' | ',' | ' ' => 0.3,
        '0'..='9' | '−' => 0.63,
        _ => 0.57,
    };
    Vec2::new(text.chars().map(width).sum(), 1.2) * TYPE_SIZE
}

fn colours(quantity: &Quantity, sequential: SequentialMap) -> &'static ColourMap {
    static DIVERGING: OnceLock<ColourMap> = OnceLock::new();
    const STOPS: [Rgb; 5] = [
        [0x0b, 0x3d, 0x91],
        [0x5b, 0x9b, 0xe6],
        WHITE,
        [0xf0, 0x87, 0x5a],
        [0x9a, 0x2c, 0x06],
    ];
    if quantity.is_diverging() {
        DIVERGING.get_or_init(|| ColourMap::diverging(STOPS))
    } else {
        sequential.colours()
    }
}

fn rgb(ink: Ink) -> Rgb {
    match ink {
        Ink::Grid => GRID,
        Ink::Edge => EDGE,
        Ink::Label | Ink::Text => INK,
        Ink::Ground | Ink::Node => WHITE,
        Ink::Rim => [0; 3],
        Ink::Warning => hue_rgb(Hue::Orange),
        Ink::Accent => hue_rgb(Hue::Blue),
    }
}

/// Paints a layout into an area of the canvas.
struct Pen<'a> {
    canvas: &'a mut Canvas,
    area: Area,
}

impl Pen<'_> {
    fn at(&self, place: Vec2) -> At {
        let [x, y] = place.as_dvec2().to_array();
        [self.area.left + x * SCALE, self.area.top + y * SCALE]
    }

    fn draw_surface(&mut self, surface: &Surface, drawing: &Drawing, figure: &SurfaceFigure) {
        self.draw_frame(&drawing.lines, &drawing.texts);
        let mesh = &drawing.mesh;
        self.canvas.begin_facets();
        for (cells, lines) in mesh.strips() {
            cells.iter().for_each(|&cell| self.draw_cell(mesh, cell));
            self.draw_contours(lines);
        }
        self.canvas.end_group();
        if let Some(section) = &figure.section {
            for piece in section.pieces(surface, &drawing.sight) {
                let ends: Vec<[At; 2]> = piece
                    .windows(2)
                    .map(|ends| [ends[0], ends[1]].map(|at| self.at(at.as_vec2())))
                    .collect();
                self.canvas
                    .segments(&ends, Stroke::new(hue_rgb(Hue::Orange), 1.5 * SCALE), 1.0);
            }
        }
        for Disc {
            at,
            radius,
            ring,
            ink,
            opacity,
        } in drawing.dots.discs(figure.marked_node, &figure.lit_nodes)
        {
            let [radius, opacity] = [radius, opacity].map(f64::from);
            let ring = ring.map(|width| f64::from(width) * SCALE);
            self.canvas.circle(self.at(at), radius * SCALE, ring, rgb(ink), opacity);
        }
    }

    fn draw_frame(&mut self, lines: &[Line], texts: &[Text]) {
        for lines in lines.chunk_by(|a, b| a.ink == b.ink) {
            let ends: Vec<[At; 2]> = lines
                .iter()
                .map(|line| [self.at(line.from), self.at(line.to)])
                .collect();
            self.canvas
                .segments(&ends, Stroke::new(rgb(lines[0].ink), 0.75 * SCALE), 1.0);
        }
        for Text { bounds, text } in texts {
            let middle = self.at(bounds.middle());
            self.canvas.text(middle, Anchor::Middle, rgb(Ink::Label), text);
        }
    }

    /// A cell in the mean colour of its corners.
    fn draw_cell(&mut self, mesh: &Mesh, cell: u32) {
        let corners = mesh.corners(cell).map(|corner| mesh.vertices[corner]);
        let mut colour = [0; 3];
        for (part, mean) in colour.iter_mut().enumerate() {
            *mean = (corners.iter().map(|corner| u16::from(corner.colour[part])).sum::<u16>() / 4) as u8;
        }
        let opacity = corners.iter().map(|corner| corner.opacity).sum::<f32>() / 4.0;
        let places = corners.map(|corner| self.at(corner.at));
        self.canvas.facet(&places, colour, f64::from(opacity));
    }

    fn draw_contours(&mut self, lines: &[ContourLine]) {
        let look = |line: &ContourLine| (line.is_black, line.opacity);
        for lines in lines.chunk_by(|a, b| look(a) == look(b)) {
            let ends: Vec<[At; 2]> = lines
                .iter()
                .map(|line| [self.at(line.from), self.at(line.to)])
                .collect();
            let (is_black, opacity) = look(&lines[0]);
            let ink = if is_black { [0; 3] } else { WHITE };
            self.canvas.segments(&ends, Stroke::new(ink, SCALE), f64::from(opacity));
        }
    }

    fn draw_scale(&mut self, scale: &ColourScale) {
        let bounds = layout(self.area.width, self.area.height);
        let Some(drawing) = scale.lay_out(bounds, &measure) else {
            return;
        };
        let [left, top] = self.at(drawing.bar.min);
        let [right, bottom] = self.at(drawing.bar.max);
        let bar = Area {
            left,
            top,
            width: right - left,
            height: bottom - top,
        };
        let step = bar.height / BAR_STEPS as f64;
        for at in (0..BAR_STEPS).rev() {
            let block = Area {
                top: bottom - step * (at + 1) as f64,
                height: step,
                ..bar
            };
            let colour = colours(&scale.quantity, scale.colours).at((at as f32 + 0.5) / BAR_STEPS as f32);
            self.canvas.block(block, colour);
        }
        self.canvas.outline(bar, Stroke::new(EDGE, 0.75 * SCALE));
        self.draw_frame(&drawing.lines, &drawing.texts);
    }
}
