//! Draws egui's tessellated output on the CPU, so that pictures of the window can be made and compared on machines
//! without any graphics driver. Textured triangles with four samples per pixel, blended as egui's own renderers do:
//! premultiplied, in gamma space. Paint callbacks are not drawn.

use std::collections::HashMap;

use eframe::egui::{
    ClippedPrimitive, Color32, ColorImage, Context, FullOutput, ImageData, Mesh, Pos2, Rect, TextureId, TexturesDelta,
    epaint::Primitive, epaint::Vertex,
};
use egui_kittest::TestRenderer;
use image::{Rgba, RgbaImage};

/// Sample positions within a pixel, off the lines that layouts favour.
const SAMPLES: [[f32; 2]; 4] = [[0.376, 0.124], [0.876, 0.374], [0.124, 0.626], [0.624, 0.876]];

/// A renderer for `egui_kittest::HarnessBuilder::renderer`, or for a [`FullOutput`] at hand.
#[derive(Default)]
pub(crate) struct Rasteriser {
    textures: HashMap<TextureId, ColorImage>,
}

impl Rasteriser {
    /// Draws tessellated primitives on a transparent picture of `size` pixels.
    pub(crate) fn draw(&self, primitives: &[ClippedPrimitive], size: [u32; 2], pixels_per_point: f32) -> RgbaImage {
        let mut canvas = Canvas::new(size);
        for ClippedPrimitive { clip_rect, primitive } in primitives {
            if let Primitive::Mesh(mesh) = primitive {
                let clip = Rect::from_min_max(
                    (clip_rect.min.to_vec2() * pixels_per_point).round().to_pos2(),
                    (clip_rect.max.to_vec2() * pixels_per_point).round().to_pos2(),
                );
                canvas.mesh(mesh, self.textures.get(&mesh.texture_id), clip, pixels_per_point);
            }
        }
        canvas.into_image()
    }
}

impl TestRenderer for Rasteriser {
    fn handle_delta(&mut self, delta: &mut TexturesDelta) {
        for (id, patches) in delta.set.drain() {
            for patch in patches {
                let ImageData::Color(image) = patch.image;
                match (patch.pos, self.textures.get_mut(&id)) {
                    (Some([left, top]), Some(texture)) => {
                        for row in 0..image.size[1] {
                            let target = (top + row) * texture.size[0] + left;
                            let source = row * image.size[0];
                            texture.pixels[target..target + image.size[0]]
                                .copy_from_slice(&image.pixels[source..source + image.size[0]]);
                        }
                    }
                    _ => {
                        self.textures.insert(id, (*image).clone());
                    }
                }
            }
        }
        for id in delta.free.drain() {
            self.textures.remove(&id);
        }
    }

    fn render(&mut self, ctx: &Context, output: &FullOutput) -> Result<RgbaImage, String> {
        let primitives = ctx.tessellate(output.shapes.clone(), output.pixels_per_point);
        let size = ctx.content_rect().size() * output.pixels_per_point;
        Ok(self.draw(
            &primitives,
            [size.x.round() as u32, size.y.round() as u32],
            output.pixels_per_point,
        ))
    }
}

struct Canvas {
    size: [u32; 2],
    /// Premultiplied, 0..=255, [`SAMPLES`] per pixel.
    samples: Vec<[f32; 4]>,
}

impl Canvas {
    fn new(size: [u32; 2]) -> Self {
        Self {
            size,
            samples: vec![[0.0; 4]; (size[0] * size[1]) as usize * SAMPLES.len()],
        }
    }

    fn mesh(&mut self, mesh: &Mesh, texture: Option<&ColorImage>, clip: Rect, pixels_per_point: f32) {
        let clip = clip.intersect(Rect::from_min_max(
            Pos2::ZERO,
            Pos2::new(self.size[0] as f32, self.size[1] as f32),
        ));
        for corners in mesh.indices.chunks_exact(3) {
            let corners = [0, 1, 2].map(|corner| {
                let vertex = mesh.vertices[corners[corner] as usize];
                Vertex {
                    pos: (vertex.pos.to_vec2() * pixels_per_point).to_pos2(),
                    ..vertex
                }
            });
            self.triangle(corners, texture, clip);
        }
    }

    fn triangle(&mut self, [a, b, c]: [Vertex; 3], texture: Option<&ColorImage>, clip: Rect) {
        let area = (b.pos - a.pos).rot90().dot(c.pos - a.pos);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        // Barycentric coordinates of a point, all positive within the triangle.
        let parts = |p: Pos2| {
            let part = |from: Pos2, to: Pos2| (to - from).rot90().dot(p - from) / area;
            [part(b.pos, c.pos), part(c.pos, a.pos), part(a.pos, b.pos)]
        };
        let bounds = Rect::from_points(&[a.pos, b.pos, c.pos]).intersect(clip);
        if !bounds.is_positive() {
            return;
        }
        for y in bounds.top().floor() as u32..bounds.bottom().ceil() as u32 {
            for x in bounds.left().floor() as u32..bounds.right().ceil() as u32 {
                let at = |offset: [f32; 2]| Pos2::new(x as f32 + offset[0], y as f32 + offset[1]);
                let covers = SAMPLES.map(|s| clip.contains(at(s)) && parts(at(s)).iter().all(|&part| part >= 0.0));
                if !covers.contains(&true) {
                    continue;
                }
                // One colour per pixel, from its centre, as on graphics cards.
                let weights = parts(at([0.5, 0.5]));
                let mix = |values: [f32; 3]| values[0] * weights[0] + values[1] * weights[1] + values[2] * weights[2];
                let texel = texture.map_or([255.0; 4], |texture| {
                    sample(texture, mix([a.uv.x, b.uv.x, c.uv.x]), mix([a.uv.y, b.uv.y, c.uv.y]))
                });
                let colours = [a, b, c].map(|vertex| vertex.color.to_array());
                let colour: [f32; 4] = std::array::from_fn(|channel| {
                    mix(colours.map(|colour| f32::from(colour[channel]))).clamp(0.0, 255.0) * texel[channel] / 255.0
                });
                let first = (y * self.size[0] + x) as usize * SAMPLES.len();
                for (sample, _) in self.samples[first..]
                    .iter_mut()
                    .zip(covers)
                    .filter(|(_, covered)| *covered)
                {
                    for (under, over) in sample.iter_mut().zip(colour) {
                        *under = over + *under * (1.0 - colour[3] / 255.0);
                    }
                }
            }
        }
    }

    fn into_image(self) -> RgbaImage {
        let count = SAMPLES.len() as f32;
        RgbaImage::from_fn(self.size[0], self.size[1], |x, y| {
            let first = (y * self.size[0] + x) as usize * SAMPLES.len();
            let samples = &self.samples[first..first + SAMPLES.len()];
            let [r, g, b, a] =
                std::array::from_fn(|channel| (samples.iter().map(|s| s[channel]).sum::<f32>() / count + 0.5) as u8);
            Rgba(Color32::from_rgba_premultiplied(r, g, b, a).to_srgba_unmultiplied())
        })
    }
}

/// Samples the texture with linear interpolation between its pixels.
fn sample(texture: &ColorImage, u: f32, v: f32) -> [f32; 4] {
    let [width, height] = texture.size;
    let place = |part: f32, count: usize| {
        let at = (part * count as f32 - 0.5).clamp(0.0, (count - 1) as f32);
        let lower = at as usize;
        (lower, (lower + 1).min(count - 1), at.fract())
    };
    let ((left, right, x), (top, bottom, y)) = (place(u, width), place(v, height));
    let texel = |column: usize, row: usize| texture.pixels[row * width + column].to_array().map(f32::from);
    let corners = [
        texel(left, top),
        texel(right, top),
        texel(left, bottom),
        texel(right, bottom),
    ];
    let mix = |from: f32, to: f32, part: f32| from + (to - from) * part;
    std::array::from_fn(|i| {
        mix(
            mix(corners[0][i], corners[1][i], x),
            mix(corners[2][i], corners[3][i], x),
            y,
        )
    })
}
