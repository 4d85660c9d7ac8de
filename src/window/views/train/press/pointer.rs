use decoupler_files::figure::surface::Ray;
use eframe::egui::{Context, Key, Modifiers, Painter, PointerButton, Pos2, Response, Shape, Stroke, pos2};
use glam::{DVec2, DVec3};

use super::{PressState, Target};
use crate::window::{test_view::Skin, theme::Palette};

/// Share of the stroke per point of scrolling: the whole stroke takes about ten notches of a typical wheel.
const SHARE_PER_POINT: f64 = 0.002;
/// Share of the stroke per press of a key.
const SHARE_PER_KEY: f64 = 0.05;
/// Number of segments of a circle.
const PIECES: usize = 64;
/// Length of a dash and of the gap behind it, in points.
const DASH: [f32; 2] = [4.0, 3.0];

impl PressState {
    /// Handles mouse and keys before anything of this frame is drawn. `lit` is the node lit by the pointer.
    pub fn take_pointer(&mut self, ctx: &Context, skin: Option<&Skin>, lit: Option<DVec3>) {
        let target = self.target.clone();
        let has_focus = |target: &Target| ctx.memory(|memory| memory.has_focus(target.id));
        let is_typing = ctx.memory(|memory| memory.focused().is_some()) && !target.as_ref().is_some_and(has_focus);
        if self.is_pressing() && !is_typing && ctx.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Escape)) {
            self.let_go();
        }
        let (Some(target), Some(skin)) = (target, skin) else {
            return;
        };
        let Some(response) = ctx.read_response(target.id) else {
            self.grip_mm = None;
            return;
        };
        let is_held = ctx.input(|input| input.pointer.button_down(PointerButton::Primary) && !input.modifiers.shift);
        let at = response.interact_pointer_pos();
        let at = at.filter(|_| is_held && response.is_pointer_button_down_on());
        let ray = at.map(|at| target.sight.ray(points(at)));
        let met = ray.and_then(|ray| match self.grip_mm {
            Some(level_mm) => ray.at_level(level_mm),
            // The line of sight may miss a lit node on a crest, and meet the surface far behind it.
            None => match lit {
                Some(node) => ray.at_level(node.z),
                None => target.surface.pick(&ray),
            },
        });
        self.grip_mm = at.and(self.grip_mm.or(met.map(|met| met.z)));
        if let Some(met) = met {
            self.place_mm = Some(within(&target, met));
        }
        self.take_wheel_and_keys(ctx, &response, &target, skin);
    }

    fn take_wheel_and_keys(&mut self, ctx: &Context, response: &Response, target: &Target, skin: &Skin) {
        if response.contains_pointer() {
            // Consumed, so that nothing else scrolls or zooms; with Ctrl it zooms as usual.
            let points = ctx.input_mut(|input| std::mem::take(&mut input.smooth_scroll_delta).y);
            self.finger.deepen(-SHARE_PER_POINT * f64::from(points));
        }
        if response.has_focus() {
            let presses = |key| ctx.input_mut(|input| input.count_and_consume_key(Modifiers::NONE, key)) as f64;
            let deeper = presses(Key::Plus) + presses(Key::Equals) - presses(Key::Minus);
            let step = DVec2::new(
                presses(Key::ArrowRight) - presses(Key::ArrowLeft),
                presses(Key::ArrowUp) - presses(Key::ArrowDown),
            );
            self.finger.deepen(SHARE_PER_KEY * deeper);
            if step != DVec2::ZERO {
                self.step(target, skin, step);
            }
        }
    }

    /// Moves the ball by half a pitch of the nodes; the first step puts it onto the middle.
    fn step(&mut self, target: &Target, skin: &Skin, step: DVec2) {
        let Some(place_mm) = self.place_mm else {
            return self.press_middle(skin);
        };
        let geometry = &skin.sensor.geometry;
        let pitch_mm = DVec2::new(geometry.row_pitch_mm, geometry.node_pitch_mm).abs();
        let moved = place_mm + 0.5 * step * pitch_mm;
        self.place_mm = Some(within(target, moved.extend(0.0)));
    }

    /// Draws where the ball touches the surface, and the line from there to the top of the axes: at the touch, otherwise
    /// under the pointer.
    pub fn outline_ui(&self, painter: &Painter, palette: &Palette, pointer: Option<Pos2>, stroke_mm: f64) {
        let Some(target) = &self.target else {
            return;
        };
        let hovered = || {
            let met = target.surface.pick(&target.sight.ray(points(pointer?)))?;
            Some(met.truncate())
        };
        let Some(place_mm) = self.place_mm.or_else(hovered) else {
            return;
        };
        let depth_mm = self.finger.depth_share * stroke_mm;
        let contact_mm = self.finger.indenter().contact_half_width_mm(depth_mm);
        let circle = (0..=PIECES).map(|piece| {
            let angle = std::f64::consts::TAU * piece as f64 / PIECES as f64;
            on_surface(target, place_mm + contact_mm * DVec2::from_angle(angle))
        });
        let circle = Vec::from_iter(circle);
        let top = place_mm.extend(*target.surface.range.end());
        let [over, under] = [top, top - DVec3::Z].map(|place| target.sight.point(place));
        // The line cannot be seen from above.
        let shaft = on_surface(target, place_mm).filter(|_| over.distance(under) > 1.0);
        let shaft = shaft.map(|foot| [foot, to_egui(over)]);
        let shaft = shaft.filter(|[foot, top]| top.distance(*foot) > DASH[0]);
        let painter = painter.with_clip_rect(target.rect.intersect(painter.clip_rect()));
        for (width, colour) in [(3.5, palette.panel.gamma_multiply(0.7)), (1.5, palette.accent)] {
            let stroke = Stroke::new(width, colour);
            // In several pieces if it crosses the edge of the surface.
            for piece in circle.split(Option::is_none).filter(|piece| piece.len() > 1) {
                painter.add(Shape::line(piece.iter().copied().flatten().collect(), stroke));
            }
            if let Some(shaft) = shaft {
                painter.extend(Shape::dashed_line(&shaft, stroke, DASH[0], DASH[1]));
            }
        }
    }
}

/// Returns the nearest place that is drawn.
fn within(target: &Target, place_mm: DVec3) -> DVec2 {
    let grid = target.surface.map.grid();
    let ends = |axis: &[f64]| (axis[0], axis[axis.len() - 1]);
    let ((x0, x1), (y0, y1)) = (ends(grid.x_mm()), ends(grid.y_mm()));
    place_mm.truncate().clamp(DVec2::new(x0, y0), DVec2::new(x1, y1))
}

/// Returns the point on the screen of the surface at a place; `None` outside the surface.
fn on_surface(target: &Target, place_mm: DVec2) -> Option<Pos2> {
    let down = Ray {
        from_mm: place_mm.extend(0.0),
        direction: DVec3::NEG_Z,
    };
    Some(to_egui(target.sight.point(target.surface.pick(&down)?)))
}

fn points(at: Pos2) -> DVec2 {
    DVec2::new(f64::from(at.x), f64::from(at.y))
}

fn to_egui(at: DVec2) -> Pos2 {
    pos2(at.x as f32, at.y as f32)
}
