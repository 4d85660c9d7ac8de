use std::sync::Arc;

use decoupler_core::{
    evaluation::{Run, RunError, RunSets, RunSettings},
    job::Job,
    network::Networks,
    scene::IndenterShape,
};
use decoupler_files::{figure::surface::Ray, machine::memory_budget};
use eframe::egui::{Context, Key, Modifiers, Painter, PointerButton, Pos2, Response, Shape, Stroke, pos2};
use glam::{DVec2, DVec3};

use super::{
    ready_settings::ready_settings,
    state::{Grip, Hand, PressState, Subject, Target, Tool},
    touch::{Print, Touch},
};
use crate::window::{
    job::{Background, JobError, Wake},
    shared::Shared,
    test_view::TestView,
    theme::Palette,
    views::train::drawn::Frames,
};

/// Share of the stroke per point of scrolling: the whole stroke takes about ten notches of a typical wheel.
const SHARE_PER_POINT: f64 = 0.002;
/// Share of the stroke per press of a key.
const SHARE_PER_KEY: f64 = 0.05;
/// Distance by which a node seen from above is dragged through the whole stroke, in points.
const POINTS_PER_STROKE: f64 = 120.0;

impl PressState {
    /// Handles mouse and keys before anything of this frame is drawn. `frames` are those displayed, and `lit` is the node lit
    /// by the pointer.
    pub fn take_pointer(&mut self, ctx: &Context, test: Option<&TestView>, frames: &Frames, lit: Option<usize>) {
        let is_not_typing = ctx.memory(|memory| memory.focused().is_none())
            || self
                .target
                .as_ref()
                .is_some_and(|target| ctx.memory(|memory| memory.has_focus(target.id)));
        if self.is_pressing() && is_not_typing && ctx.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Escape))
        {
            self.let_go();
        }
        let (Some(target), Some(test)) = (self.target.clone(), test) else {
            return;
        };
        let Some(response) = ctx.read_response(target.id).filter(|_| self.hand == Hand::Press) else {
            self.grip = None;
            return;
        };
        self.take_button(ctx, &response, &target, test, (frames, lit));
        self.take_wheel_and_keys(ctx, &response, &target, test);
    }

    fn take_button(
        &mut self,
        ctx: &Context,
        response: &Response,
        target: &Target,
        test: &TestView,
        seen: (&Frames, Option<usize>),
    ) {
        let is_held = ctx.input(|input| input.pointer.button_down(PointerButton::Primary) && !input.modifiers.shift);
        let at = response.interact_pointer_pos();
        let Some(at) = at.filter(|_| is_held && response.is_pointer_button_down_on()) else {
            self.grip = None;
            return;
        };
        match self.grip {
            None => self.grip = Some(self.take_hold(target, test, seen, at)),
            Some(Grip::Level(z_mm)) => {
                if let Some(met) = target.sight.ray(points(at)).at_level(z_mm) {
                    self.print_at(within(target, met), test.stroke_mm);
                }
            }
            Some(Grip::Node { node, above_mm, begin }) => {
                let height_mm = height_mm(target, test, node, at).map(|height_mm| height_mm + above_mm);
                let dragged = f64::from(at.y - begin.1) / POINTS_PER_STROKE * test.stroke_mm;
                self.move_node(test, node, height_mm.unwrap_or(begin.0 - dragged));
            }
            Some(Grip::Missed) => {}
        }
    }

    /// The button went down.
    fn take_hold(
        &mut self,
        target: &Target,
        test: &TestView,
        (frames, lit): (&Frames, Option<usize>),
        at: Pos2,
    ) -> Grip {
        let ray = target.sight.ray(points(at));
        let nodes_mm = &frames.actual.nodes_mm;
        let lit = lit.and_then(|node| Some((node, *nodes_mm.get(node)?)));
        // Next to a lit node on a crest the line of sight may miss the surface, or meet it far behind: the node is meant.
        let on_level = lit.and_then(|(_, place)| ray.at_level(place.z));
        let met = match (target.surface.pick(&ray), on_level, lit) {
            (Some(picked), Some(on_level), Some((_, place))) if on_level.distance(place) < picked.distance(place) => {
                on_level
            }
            (Some(picked), _, _) => picked,
            (None, Some(on_level), _) => on_level,
            (None, None, _) => return Grip::Missed,
        };
        if self.finger.tool != Tool::OneNode {
            self.print_at(within(target, met), test.stroke_mm);
            return Grip::Level(met.z);
        }
        let distance = |node: &DVec3| node.truncate().distance_squared(met.truncate());
        let nearest = || {
            let nodes = nodes_mm.iter().copied().enumerate();
            nodes.min_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)))
        };
        let Some((node, place)) = lit.or_else(nearest) else {
            return Grip::Missed;
        };
        if self.touch.is_none() {
            self.touch = Some(of_frame(test, frames));
        }
        let pointer_mm = height_mm(target, test, node, at);
        Grip::Node {
            node,
            above_mm: pointer_mm.map_or(0.0, |pointer_mm| place.z - pointer_mm),
            begin: (place.z, at.y),
        }
    }

    fn move_node(&mut self, test: &TestView, node: usize, height_mm: f64) {
        let Some((address, rest)) = at_rest(test, node) else {
            return;
        };
        let depth_mm = (rest.z - height_mm).clamp(0.0, test.stroke_mm);
        if let Some(touch) = &mut self.touch {
            touch.nodes_mm.insert(address, depth_mm);
        }
    }

    fn take_wheel_and_keys(&mut self, ctx: &Context, response: &Response, target: &Target, test: &TestView) {
        let before = self.finger;
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
                self.step(target, test, step);
            }
        }
        if self.finger != before {
            self.follow_finger(test.stroke_mm);
        }
    }

    /// Moves the finger by half a pitch of the nodes; the first step puts it onto the middle.
    fn step(&mut self, target: &Target, test: &TestView, step: DVec2) {
        let place_mm = self.touch.as_ref().and_then(|touch| Some(touch.print?.place_mm));
        let Some(place_mm) = place_mm else {
            return self.press_middle(test);
        };
        let geometry = &test.sensor.geometry;
        let pitch_mm = DVec2::new(geometry.row_pitch_mm, geometry.node_pitch_mm).abs();
        let moved = place_mm + 0.5 * step * pitch_mm;
        self.print_at(within(target, moved.extend(0.0)), test.stroke_mm);
    }
}

fn points(at: Pos2) -> DVec2 {
    DVec2::new(f64::from(at.x), f64::from(at.y))
}

/// Returns the nearest place that is drawn.
fn within(target: &Target, place_mm: DVec3) -> DVec2 {
    let grid = target.surface.map.grid();
    let ends = |axis: &[f64]| (axis[0], axis[axis.len() - 1]);
    let ((x0, x1), (y0, y1)) = (ends(grid.x_mm()), ends(grid.y_mm()));
    place_mm.truncate().clamp(DVec2::new(x0, y0), DVec2::new(x1, y1))
}

/// Returns the row-wire and number of a node drawn, and its place at rest.
fn at_rest(test: &TestView, node: usize) -> Option<((usize, usize), DVec3)> {
    let per_row = test.sensor.scale.nodes_per_row();
    let (row, node) = (*test.rows.get(node / per_row)?, node % per_row);
    Some((
        (row, node),
        test.sensor.geometry.row_node_mm(test.sensor.scale, row, node),
    ))
}

/// Returns the height to which the pointer lifts or lowers a node, if it can be determined from this camera.
fn height_mm(target: &Target, test: &TestView, node: usize, at: Pos2) -> Option<f64> {
    let (_, rest) = at_rest(test, node)?;
    target.sight.height_mm(rest, test.stroke_mm, points(at))
}

/// Returns the touch that leaves every node at its height.
fn of_frame(test: &TestView, frames: &Frames) -> Touch {
    let nodes = frames.actual.nodes_mm.iter().enumerate();
    let depths = nodes.filter_map(|(node, place)| {
        let (address, rest) = at_rest(test, node)?;
        Some((address, rest.z - place.z))
    });
    Touch {
        print: None,
        nodes_mm: depths.collect(),
    }
}

/// Number of segments of a circle.
const PIECES: usize = 64;
/// Length of a dash and of the gap behind it, in points.
const DASH: [f32; 2] = [4.0, 3.0];

impl PressState {
    /// Draws where the finger touches the surface: at the touch, otherwise under the pointer.
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

/// Returns the rim of the contact on the surface, in several pieces if it crosses the edge of the surface.
fn outline(target: &Target, print: &Print) -> Vec<Vec<Pos2>> {
    let middle = print.place_mm;
    let grid = target.surface.map.grid();
    let along_y = |x_mm: f64| -> Vec<DVec2> { grid.y_mm().iter().map(|&y_mm| DVec2::new(x_mm, y_mm)).collect() };
    let half_width_mm = print.indenter.contact_half_width_mm(print.depth_mm);
    let lines = match print.indenter.shape {
        IndenterShape::Sphere { .. } | IndenterShape::FlatPunch { .. } => {
            let angle = |piece: usize| std::f64::consts::TAU * piece as f64 / PIECES as f64;
            let circle = (0..=PIECES).map(|piece| middle + half_width_mm * DVec2::from_angle(angle(piece)));
            vec![circle.collect()]
        }
        IndenterShape::Cylinder { .. } => [-1.0, 1.0].map(|side| along_y(middle.x + side * half_width_mm)).into(),
        IndenterShape::Edge { .. } => vec![along_y(middle.x)],
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
    // It cannot be seen from above.
    (over.distance(under) > 1.0 && top.distance(foot) > DASH[0]).then_some([foot, top])
}

/// Returns the point on the screen of the surface at a place; `None` outside the surface.
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

/// Message of the thread to the window.
type Trained = Result<Result<Networks, RunError>, JobError>;

/// A small network for the displayed sensor, trained quickly in the background once the user is about to press and there is
/// no other.
#[derive(Debug)]
pub struct ReadyNetwork {
    job: Background<Trained>,
    /// Settings of the network that is there or being trained.
    of: Option<RunSettings>,
    networks: Option<Arc<Networks>>,
    /// Reason why it could not be trained.
    pub(super) failure: Option<String>,
}

impl ReadyNetwork {
    pub(super) fn new(wake: Wake) -> Self {
        Self {
            job: Background::prompt("ready network", wake),
            of: None,
            networks: None,
            failure: None,
        }
    }

    /// Takes the network once it is trained.
    pub(super) fn take_events(&mut self) {
        while let Some(trained) = self.job.next_event() {
            match trained {
                Ok(Ok(networks)) => self.networks = Some(Arc::new(networks)),
                Ok(Err(RunError::Cancelled(_))) => {}
                Ok(Err(error)) => self.failure = Some(error.to_string()),
                Err(error) => self.failure = Some(error.to_string()),
            }
        }
    }

    /// Trains the network of the current test set, unless it exists or is too large to be trained quickly.
    pub(super) fn ask(&mut self, shared: &Shared) {
        let Some(settings) = settings_of(shared) else { return };
        if self.of == Some(settings) {
            return;
        }
        (self.of, self.networks, self.failure) = (Some(settings), None, None);
        self.job.start(
            move |report| {
                let is_cancelled = || report.is_cancelled();
                let job = Job::new(&is_cancelled);
                let sets = RunSets::draw(&settings, memory_budget(), &job)?;
                let mut run = Run::new(settings, sets, None, &job)?;
                run.finish(&job)?;
                Ok(run.network())
            },
            |trained| trained,
        );
    }

    /// Returns true while the network of the current test set is being trained.
    pub(super) fn is_awaited(&self, shared: &Shared) -> bool {
        self.of.is_some() && self.of == settings_of(shared) && self.job.is_under_way()
    }

    /// Returns the network, if it is that of the current test set.
    pub(super) fn subject(&self, shared: &Shared) -> Option<Subject> {
        let settings = settings_of(shared).filter(|settings| self.of == Some(*settings))?;
        Some(Subject {
            networks: Arc::clone(self.networks.as_ref()?),
            settings,
            is_ready_made: true,
            is_idle: true,
        })
    }
}

/// Returns the settings of the ready-made network for the current test set; `None` if training would take long.
fn settings_of(shared: &Shared) -> Option<RunSettings> {
    let settings = match (&shared.preview, &shared.run) {
        (Some(preview), _) => &preview.settings,
        (None, Some(run)) => run.settings(),
        (None, None) => return None,
    };
    ready_settings(settings.simulation()?)
}
