//! From radiance and tests to pixels and files.

use super::Rendering;
use prbvh::write::{WriteError, write_atomically};
use std::io;
use std::path::Path;

/// What the colours of a heat map mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Tests of a pixel in the brightest colour; more look the same.
    pub most: f32,
}

/// The picture in sRGB, 8 bits a colour, row by row from the top, `[3 · width · height]`. The exposure is such that nineteen of twenty
/// pixels that receive light are below four fifths of white.
#[must_use]
pub fn shaded(rendering: &Rendering) -> Vec<u8> {
    let luminance = |c: &[f32; 3]| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
    let mut lit: Vec<f32> = rendering.radiance.iter().map(luminance).filter(|&l| l > 0.0).collect();
    let bright = quantile(&mut lit, 0.95).unwrap_or(1.0);
    let tone = |x: f32| encode(0.8 * f64::from(x) / f64::from(bright));
    rendering.radiance.iter().flat_map(|c| c.map(tone)).collect()
}

/// The tests of each pixel as colours, from black over red and yellow to white, and their scale: the brightest colour is that of the
/// largest but for one pixel in two hundred.
#[must_use]
pub fn heat_map(rendering: &Rendering) -> (Vec<u8>, Scale) {
    let scale = Scale { most: quantile(&mut rendering.tests.clone(), 0.995).unwrap_or(0.0).max(1.0) };
    (heat_map_in(rendering, scale), scale)
}

/// The tests of each pixel as colours of a given scale, so that two pictures can be compared.
#[must_use]
pub fn heat_map_in(rendering: &Rendering, scale: Scale) -> Vec<u8> {
    let colour = |&tests: &f32| {
        let x = 3.0 * f64::from(tests) / f64::from(scale.most);
        [x, x - 1.0, x - 2.0].map(|part| (part.clamp(0.0, 1.0) * 255.0).round() as u8)
    };
    rendering.tests.iter().flat_map(colour).collect()
}

/// The value that a part of all is not above.
fn quantile(values: &mut [f32], part: f64) -> Option<f32> {
    if values.is_empty() {
        return None;
    }
    let at = ((values.len() - 1) as f64 * part) as usize;
    Some(*values.select_nth_unstable_by(at, f32::total_cmp).1)
}

/// A linear value in sRGB (IEC 61966-2-1).
fn encode(x: f64) -> u8 {
    let x = x.clamp(0.0, 1.0);
    let y = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    (y * 255.0).round() as u8
}

/// Writes `pixels[3 · width · height]` as a PNG file, whole or not at all.
///
/// # Errors
/// If the file cannot be written.
pub fn write_png(path: &Path, width: u32, height: u32, pixels: &[u8]) -> Result<(), WriteError> {
    write_atomically(path, |out| encode_png(out, width, height, pixels))
}

/// Writes `pixels[3 · width · height]` in the form of a PNG file.
///
/// # Errors
/// If `out` fails, or there are not as many pixels.
pub fn encode_png(out: &mut dyn io::Write, width: u32, height: u32, pixels: &[u8]) -> io::Result<()> {
    let mut encoder = png::Encoder::new(out, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header().map_err(io::Error::other)?;
    writer.write_image_data(pixels).map_err(io::Error::other)?;
    writer.finish().map_err(io::Error::other)
}
