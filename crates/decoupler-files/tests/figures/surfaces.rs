//! Figures of surfaces: positions, colours, and texts in print.

use std::sync::Arc;

use decoupler_core::surface::SurfaceMap;
use decoupler_files::{
    export::figures::Picture,
    figure::{
        Bounds, Figure, SequentialMap, Shape,
        surface::{Drawing, OrbitCamera, Piece, Quantity, Section, SectionLine, Surface, SurfaceFigure, ViewMode},
    },
};
use glam::{DVec3, Vec2};
use resvg::usvg::roxmltree::Document;

fn draw(figure: &SurfaceFigure) -> Picture {
    Figure::from(figure.clone()).draw()
}

/// A surface over 4 × 5 nodes a millimetre apart.
fn surface(title: &str, quantity: Quantity, value: impl Fn(f64, f64) -> f64) -> Surface {
    over([4, 5], title, quantity, value)
}

fn over([rows, per_row]: [usize; 2], title: &str, quantity: Quantity, value: impl Fn(f64, f64) -> f64) -> Surface {
    let places = |count: usize| -> Vec<f64> { (0..count).map(|at| at as f64).collect() };
    let map = Arc::new(SurfaceMap::new(&places(rows), &places(per_row)).unwrap());
    let nodes = (0..rows * per_row).map(|node| ((node / per_row) as f64, (node % per_row) as f64));
    let nodes: Arc<[DVec3]> = nodes.map(|(x, y)| DVec3::new(x, y, value(x, y))).collect();
    let values = map.evaluate(&nodes.iter().map(|node| node.z).collect::<Vec<_>>());
    Surface {
        title: title.to_owned(),
        values: values.into(),
        nodes,
        map,
        range: match quantity {
            Quantity::Error => -0.5..=0.5,
            _ => 4.0..=5.0,
        },
        quantity,
        mode: ViewMode::ThreeD,
        colours: SequentialMap::default(),
    }
}

fn dent(title: &str) -> Surface {
    surface(title, Quantity::Height, |x, y| {
        5.0 - (-(x - 1.0).powi(2) - (y - 2.0).powi(2)).exp()
    })
}

fn error() -> Surface {
    surface("Error", Quantity::Error, |x, y| 0.1 * x - 0.1 * y)
}

fn from_above(surface: Surface) -> Surface {
    Surface {
        mode: ViewMode::Top,
        ..surface
    }
}

fn figure(surfaces: Vec<Surface>) -> SurfaceFigure {
    SurfaceFigure {
        surfaces,
        camera: OrbitCamera::default(),
        ..SurfaceFigure::default()
    }
}

fn lay_out(surface: &Surface, camera: OrbitCamera) -> Drawing {
    let card = Bounds::of_size(Vec2::ZERO, Vec2::new(360.0, 400.0));
    let measure = |text: &str| Vec2::new(6.0 * text.chars().count() as f32, 14.0);
    surface.lay_out(camera, card, &measure, SequentialMap::Viridis.colours())
}

/// Returns the number of times that a picture contains a text.
fn says(picture: &Picture, text: &str) -> usize {
    picture.svg().matches(&format!(">{text}</text>")).count()
}

#[test]
fn contour_lines_of_a_slope_are_at_their_heights() {
    // 4.05 + 0.3 x reaches 4.1, 4.2 … at x = (level − 4.05) / 0.3 for any y.
    let slope = from_above(surface("", Quantity::Height, |x, _| 4.05 + 0.3 * x));
    let drawing = lay_out(&slope, OrbitCamera::default());
    let x_at = |node: usize| drawing.dots.position(node).unwrap().x;
    let points_per_mm = (x_at(15) - x_at(0)) / 3.0;
    let mut seen = [0; 10];
    for piece in &drawing.mesh.pieces {
        let Piece::Line(ends, _) = piece else { continue };
        for end in ends {
            let height = 4.05 + 0.3 * f64::from((end.x - x_at(0)) / points_per_mm);
            let level = (10.0 * height).round();
            assert!((10.0 * height - level).abs() < 0.01, "a line at {height} mm");
            seen[level as usize - 40] += 1;
        }
    }
    // The line at 4.0 would be in the margin; heights are cut at the ends of the scale.
    assert!(seen[1..].iter().all(|ends| *ends > 20), "{seen:?}");
}

/// Returns the places of the corners of the cells that are drawn, each with its grid point in millimetres.
fn drawn_corners(surface: &Surface, drawing: &Drawing) -> Vec<(DVec3, Vec2)> {
    let (x_mm, y_mm) = (surface.map.grid().x_mm(), surface.map.grid().y_mm());
    let cells = drawing.mesh.pieces.iter().filter_map(|piece| match piece {
        Piece::Cell(cell) => Some(*cell),
        Piece::Line(..) => None,
    });
    let place = |corner: usize| {
        let (ix, iy) = (corner / y_mm.len(), corner % y_mm.len());
        DVec3::new(x_mm[ix], y_mm[iy], surface.values[corner])
    };
    let corners = cells.flatten();
    corners
        .map(|corner| (place(corner), drawing.mesh.vertices[corner].at))
        .collect()
}

/// The axis goes from 3.92 to 5.08 mm: in space, the surface stays between these planes, also in the extrapolated margin,
/// and is marked there. A map has no axis for heights and no holes.
#[test]
fn beyond_the_axis_a_surface_is_a_marked_plateau_and_a_map_is_whole() {
    let slope = |x: f64, _: f64| 4.05 + 0.32 * x;
    let peak = |x: f64, y: f64| if (x, y) == (1.0, 2.0) { 5.4 } else { 4.4 };
    let cases: [(&dyn Fn(f64, f64) -> f64, _); 2] = [
        (&slope, "Beyond the axes: hatched"),
        (&peak, "Beyond the axes: hatched, 1 node"),
    ];
    for (height, note) in cases {
        let in_space = surface("", Quantity::Height, height);
        let drawing = lay_out(&in_space, OrbitCamera::default());
        let corners = drawn_corners(&in_space, &drawing);
        let grid = in_space.map.grid();
        assert_eq!(corners.len(), 4 * (grid.x_mm().len() - 1) * (grid.y_mm().len() - 1));
        for (place, at) in &corners {
            let seen = drawing.sight.point(place.with_z(place.z.clamp(3.92, 5.08))).as_vec2();
            assert!(at.distance(seen) < 0.01, "{place}");
        }
        assert!(corners.iter().filter(|(place, _)| place.z > 5.08).count() > 20);
        assert_eq!(drawing.note.as_deref(), Some(note));
        let map = from_above(in_space);
        let drawing = lay_out(&map, OrbitCamera::default());
        assert_eq!(drawn_corners(&map, &drawing).len(), corners.len());
        assert_eq!(drawing.note, None);
    }
}

#[test]
fn from_above_x_runs_to_the_right_and_y_upwards_at_one_scale() {
    let drawing = lay_out(&from_above(dent("")), OrbitCamera::default());
    let [origin, along_y, along_x] = [0, 1, 5].map(|node| drawing.dots.position(node).unwrap());
    let (right, up) = (along_x - origin, origin - along_y);
    assert!(right.x > 10.0 && right.y.abs() < 1e-3 && up.x.abs() < 1e-3);
    assert!((right.x - up.y).abs() < 1e-3, "a millimetre is as long on both axes");
}

#[test]
fn the_camera_turns_only_surfaces_in_space() {
    let turned = OrbitCamera::default().dragged(60.0, 20.0);
    let lines = |surface: &Surface, camera| -> Vec<Shape> { lay_out(surface, camera).frame };
    for (surface, is_turned) in [(dent(""), true), (from_above(dent("")), false)] {
        assert_eq!(
            lines(&surface, turned) != lines(&surface, OrbitCamera::default()),
            is_turned
        );
        let seen = |camera| {
            let surfaces = vec![surface.clone()];
            draw(&SurfaceFigure {
                camera,
                ..figure(surfaces)
            })
        };
        assert_eq!(seen(turned) != seen(OrbitCamera::default()), is_turned);
    }
}

#[test]
fn surfaces_of_one_scale_have_one_key_and_errors_their_own() {
    let heights = figure(vec![dent("Actual"), dent("Decoupled")]);
    let picture = draw(&heights);
    assert_eq!(["Actual", "Decoupled"].map(|title| says(&picture, title)), [1, 1]);
    assert_eq!(says(&picture, "z (mm)"), 3, "two axes and a key");
    let note = "Between the nodes: thin-plate spline (the biharmonic spline with a plane).";
    assert_eq!(says(&picture, note), 1);

    let three = figure(vec![dent("Actual"), dent("Decoupled"), error()]);
    let picture = draw(&three);
    assert_eq!([says(&picture, "z (mm)"), says(&picture, "error (mm)")], [3, 2]);
    let negative = picture.svg().matches(">−0.").count();
    assert!(negative >= 2, "{negative} negative ticks on axis and key");
}

#[test]
fn scales_are_made_common_by_quantity() {
    let lower = Surface {
        range: 3.0..=4.5,
        ..dent("B")
    };
    let figure = figure(vec![dent("A"), lower, error()]).with_common_scales();
    let scales = figure.scales().into_iter();
    let scales: Vec<_> = scales
        .map(|surface| (&surface.quantity, surface.range.clone()))
        .collect();
    assert_eq!(scales, [(&Quantity::Height, 3.0..=5.0), (&Quantity::Error, -0.5..=0.5)]);
}

/// Fills of the cells of a picture, the most frequent first.
fn fills(picture: &Picture) -> Vec<String> {
    let mut counts = std::collections::BTreeMap::new();
    let document = Document::parse(picture.svg()).unwrap();
    let cards = document.descendants().filter(|node| node.has_attribute("clip-path"));
    let cells = cards
        .flat_map(|card| card.descendants())
        .filter(|node| node.has_tag_name("path"));
    for fill in cells.filter_map(|cell| cell.attribute("fill").filter(|fill| *fill != "none")) {
        *counts.entry(fill.to_owned()).or_insert(0) += 1;
    }
    let mut fills: Vec<_> = counts.into_iter().collect();
    fills.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    fills.into_iter().map(|(fill, _)| fill).collect()
}

#[test]
fn a_height_has_one_colour_on_every_card_and_zero_error_is_white() {
    let level = |z: f64| from_above(surface("", Quantity::Height, |_, _| z));
    let drawn = |surfaces| fills(&draw(&figure(surfaces)));
    let [alone, both] = [vec![level(4.5)], vec![level(4.5), level(4.5)]].map(drawn);
    assert_eq!((alone.len(), &alone), (1, &both));
    let [red, green, blue] = SequentialMap::Viridis.colours().at(0.5);
    assert_eq!(alone[0], format!("#{red:02x}{green:02x}{blue:02x}"));
    let other = drawn(vec![level(4.5), level(5.0)]);
    assert!(other.len() == 2 && other.contains(&alone[0]), "{other:?}");

    let none = from_above(surface("", Quantity::Error, |_, _| 0.0));
    assert_eq!(drawn(vec![none]), ["#ffffff"]);
    let both_signs = drawn(vec![from_above(error())]);
    assert!(both_signs.len() > 30, "{} colours", both_signs.len());
}

#[test]
fn marked_and_highlighted_nodes_the_section_and_the_chosen_colours_are_printed() {
    let with = |change: &dyn Fn(&mut SurfaceFigure)| {
        let mut figure = figure(vec![from_above(dent("Actual"))]);
        change(&mut figure);
        draw(&figure)
    };
    let plain = with(&|_| ());
    let rings = |picture: Picture| picture.svg().matches("<circle").count() - plain.svg().matches("<circle").count();
    let lit = with(&|figure| figure.lit_nodes = vec![1, 5, 999]);
    assert_eq!(rings(lit), 4, "two rings around each of two nodes");
    for (node, expected) in [(7, 3), (999, 0)] {
        let marked = with(&|figure| figure.marked_node = Some(node));
        assert_eq!(rings(marked), expected, "a disc and two rings");
    }
    for (at_mm, is_next_to_the_surface) in [(1.0, false), (99.0, true)] {
        let line = SectionLine::RowWire(1);
        let section = with(&|figure| figure.section = Some(Section { line, at_mm }));
        assert_eq!(section.svg() == plain.svg(), is_next_to_the_surface);
    }
    let cividis = with(&|figure| figure.surfaces[0].colours = SequentialMap::Cividis);
    assert_ne!(cividis.svg(), plain.svg());
}

#[test]
fn nodes_beyond_the_axes_are_reported() {
    let mut surface = from_above(dent("Actual"));
    Arc::make_mut(&mut surface.nodes)[0].x = -7.0;
    let picture = draw(&figure(vec![surface]));
    assert_eq!(says(&picture, "1 node beyond the axes is drawn at their edge"), 1);
}

#[test]
fn unusual_surfaces_are_drawn() {
    let mut gaps = dent("Actual");
    Arc::make_mut(&mut gaps.values)[5000] = f64::NAN;
    Arc::make_mut(&mut gaps.nodes)[3].z = f64::NAN;
    let empty = Surface {
        values: Arc::new([]),
        ..dent("Actual")
    };
    let single = |scale| over(scale, "Actual", Quantity::Height, |_, _| 4.5);
    let nothing = surface("Actual", Quantity::Height, |_, _| f64::NAN);
    let odd = [
        gaps,
        empty,
        nothing,
        single([1, 1]),
        single([2, 2]),
        single([1, 9]),
        single([30, 40]),
    ];
    for surface in odd {
        for mode in [ViewMode::ThreeD, ViewMode::Top] {
            for range in [4.0..=5.0, 5.0..=5.0, f64::NAN..=f64::NAN, 5.0..=4.0] {
                let (range, surface) = (range, surface.clone());
                let surface = Surface { mode, range, ..surface };
                let picture = draw(&figure(vec![surface.clone(), surface]));
                assert_eq!(
                    picture.svg().matches("NaN").count() + picture.svg().matches("inf").count(),
                    0
                );
                assert_eq!(says(&picture, "Actual"), 2);
            }
        }
    }
    draw(&figure(Vec::new())).png().unwrap();
}
