use eframe::egui::{Painter, Pos2, Shape, Stroke, pos2};
use glam::{DVec2, DVec3};

use super::{finger::Hand, state::PressState, target::Target};
use crate::window::theme::Palette;
use decoupler_core::scene::{Contact, Print};
use decoupler_files::figure::surface::Ray;

/// Pieces of a circle.
const PIECES: usize = 64;
/// Length of a dash and of the gap behind it, in points.
const DASH: [f32; 2] = [4.0, 3.0];

impl PressState {
    /// Draws where the finger touches the surface: around what is pressed, otherwise under the pointer.
    pub fn outline_ui(&self, painter: &Painter, palette: &Palette, pointer: Option<Pos2>, stroke_mm: f64) {
        let Some(target) = self.target.as_ref().filter(|_| self.hand == Hand::Press) else {
            return;
        };
        let pressed = self.touch.as_ref().map(|touch| touch.print);
        let hovered = || {
            let at = pointer?;
            let at = DVec2::new(f64::from(at.x), f64::from(at.y));
            let met = target.surface.pick(&target.sight.ray(at))?;
            self.finger.print(met.truncate(), stroke_mm)
        };
        let Some(print) = pressed.unwrap_or_else(hovered) else {
            return;
        };
        let painter = painter.with_clip_rect(target.rect.intersect(painter.clip_rect()));
        let lines = outline(target, &print);
        for (width, colour) in [(3.5, palette.panel.gamma_multiply(0.7)), (1.5, palette.accent)] {
            let stroke = Stroke::new(width, colour);
            for line in &lines {
                painter.add(Shape::line(line.clone(), stroke));
            }
            if let Some([foot, top]) = shaft(target, &print) {
                painter.extend(Shape::dashed_line(&[foot, top], stroke, DASH[0], DASH[1]));
            }
        }
    }
}

/// The rim of the contact on the surface, in pieces where the surface ends.
fn outline(target: &Target, print: &Print) -> Vec<Vec<Pos2>> {
    let middle = print.place_mm;
    let grid = target.surface.map.grid();
    let along_y = |x_mm: f64| -> Vec<DVec2> { grid.y_mm().iter().map(|&y_mm| DVec2::new(x_mm, y_mm)).collect() };
    let lines = match print.indenter.contact(print.depth_mm) {
        Contact::Disc { radius_mm } => {
            let angle = |piece: usize| std::f64::consts::TAU * piece as f64 / PIECES as f64;
            let circle = (0..=PIECES).map(|piece| middle + radius_mm * DVec2::from_angle(angle(piece)));
            vec![circle.collect()]
        }
        Contact::Strip { half_width_mm } => [-1.0, 1.0].map(|side| along_y(middle.x + side * half_width_mm)).into(),
        Contact::HalfPlane => vec![along_y(middle.x)],
    };
    let pieces = lines.into_iter().flat_map(|line: Vec<DVec2>| {
        let seen: Vec<Option<Pos2>> = line.into_iter().map(|place| on_surface(target, place)).collect();
        let pieces = seen.split(Option::is_none).filter(|piece| piece.len() > 1);
        pieces
            .map(|piece| piece.iter().copied().flatten().collect())
            .collect::<Vec<Vec<Pos2>>>()
    });
    pieces.collect()
}

/// The finger itself: from the surface up to the top of the axes.
fn shaft(target: &Target, print: &Print) -> Option<[Pos2; 2]> {
    let foot = on_surface(target, print.place_mm)?;
    let top = print.place_mm.extend(*target.surface.range.end());
    let [over, under] = [top, top - DVec3::Z].map(|place| target.sight.point(place));
    let top = to_egui(over);
    // From above there is nothing of it to be seen.
    (over.distance(under) > 1.0 && top.distance(foot) > DASH[0]).then_some([foot, top])
}

/// The point on the screen of the surface at a place; `None` where there is none.
fn on_surface(target: &Target, place_mm: DVec2) -> Option<Pos2> {
    let down = Ray {
        from_mm: place_mm.extend(0.0),
        direction: DVec3::NEG_Z,
    };
    Some(to_egui(target.sight.point(target.surface.pick(&down)?)))
}

fn to_egui(at: DVec2) -> Pos2 {
    pos2(at.x as f32, at.y as f32)
}
