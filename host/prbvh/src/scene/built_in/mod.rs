//! The built-in scene: a hall, 30 × 9 × 12 metres, y upwards.
//!
//! It has what makes the tree of an interior hard: walls of two triangles beside blades of a centimetre, rails as long as the
//! hall and as thin as a finger, shelves as long with books between them, dense curved detail in small places, and much
//! empty space. Reinsertion cuts the SAH cost of its LBVH to about 0.6.

mod mesh;
mod noise;

use mesh::{Mesh, Point, add, angle, grid, scaled, turn};
pub use noise::Noise;
use prbvh_kernel::setup::Triangle;

/// Triangles of the built-in scene unless another number is asked for.
pub const DEFAULT_TRIANGLES: usize = 250_000;

const LENGTH: f64 = 30.0;
const HEIGHT: f64 = 9.0;
const WIDTH: f64 = 12.0;
/// The two rows of columns.
const ROWS: [f64; 2] = [3.0, 9.0];
const COLUMNS_PER_ROW: usize = 7;
const COLUMN_HEIGHT: f64 = 5.0;
const UP: Point = [0.0, 1.0, 0.0];

/// Exactly `triangles` triangles. Each part gets a share of them; the tufts of the carpet take up the rest.
pub(super) fn hall(triangles: usize) -> Vec<Triangle> {
    let mut mesh = Mesh::new(triangles);
    let share = |percent: usize| (triangles as u64 * percent as u64 / 100) as usize;
    shell(&mut mesh);
    columns(&mut mesh, share(14));
    arches(&mut mesh, share(5));
    shelves(&mut mesh, share(18));
    benches(&mut mesh, share(9));
    chandeliers(&mut mesh, share(18));
    statue(&mut mesh, share(11));
    railings(&mut mesh, share(10));
    cables(&mut mesh, share(4));
    tufts(&mut mesh);
    mesh.triangles
}

fn column_x(k: usize) -> f64 {
    3.0 + 4.0 * k as f64
}

/// Walls, floor, ceiling, the base of the carpet and the steps at its end.
fn shell(mesh: &mut Mesh) {
    mesh.cuboid([0.0; 3], [LENGTH, HEIGHT, WIDTH]);
    mesh.quad([1.0, 0.01, 5.0], [27.0, 0.01, 5.0], [27.0, 0.01, 7.0], [1.0, 0.01, 7.0]);
    for step in 0..3 {
        let step = f64::from(step);
        mesh.cuboid([27.0 + 0.5 * step, 0.18 * step, 3.5], [29.8, 0.18 * (step + 1.0), 8.5]);
    }
}

/// Fluted columns with base and capital.
fn columns(mesh: &mut Mesh, budget: usize) {
    let (sides, rings) = grid(budget / (2 * COLUMNS_PER_ROW), 1.4, (3, 2));
    for z in ROWS {
        for k in 0..COLUMNS_PER_ROW {
            mesh.surface(sides, rings, |i, j| {
                let height = j as f64 / rings as f64;
                let foot = 1.0 + 0.5 * power_8(1.0 - height) + 0.6 * power_8(height) - 0.15 * height;
                let flutes = angle(20.0 * (i % sides) as f64 / sides as f64).0;
                let (c, s) = turn(i, sides);
                let radius = 0.35 * foot * (1.0 - 0.04 * flutes * flutes);
                [column_x(k) + radius * c, COLUMN_HEIGHT * height, z + radius * s]
            });
        }
    }
}

fn power_8(x: f64) -> f64 {
    let x2 = x * x;
    let x4 = x2 * x2;
    x4 * x4
}

/// Half circles of square section from column to column, along the rows and across the hall.
fn arches(mesh: &mut Mesh, budget: usize) {
    const SQUARE: [(f64, f64); 4] = [(-0.2, -0.25), (0.2, -0.25), (0.2, 0.25), (-0.2, 0.25)];
    const ALONG: usize = COLUMNS_PER_ROW - 1;
    let arches = (budget / 16).clamp(1, 2 * ALONG + COLUMNS_PER_ROW);
    let steps = (budget / (8 * arches)).max(2);
    for arch in 0..arches {
        let (centre, radius, direction, side) = if arch < 2 * ALONG {
            let middle = [column_x(arch / 2) + 2.0, COLUMN_HEIGHT, ROWS[arch % 2]];
            (middle, 2.0, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
        } else {
            let middle = [column_x(arch - 2 * ALONG), COLUMN_HEIGHT, WIDTH / 2.0];
            (middle, 3.0, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
        };
        mesh.surface(4, steps, |i, j| {
            let (c, s) = angle(j as f64 / steps as f64 / 2.0);
            let (out, across) = SQUARE[i % 4];
            let on_arch = add(scaled(direction, c * (radius + out)), scaled(UP, s * (radius + out)));
            add(centre, add(on_arch, scaled(side, across)))
        });
    }
}

/// Shelves along both long walls, full of books of all sizes.
fn shelves(mesh: &mut Mesh, budget: usize) {
    const LEVELS: usize = 9;
    let shelves = (budget / 12 / 8).clamp(1, 2 * LEVELS);
    let books = (budget / 12).saturating_sub(shelves);
    let mut noise = Noise::new(2);
    for shelf in 0..shelves {
        let y = 0.1 + 0.4 * (shelf / 2) as f64;
        let wall = [0.02, WIDTH - 0.32][shelf % 2];
        mesh.cuboid([0.5, y, wall], [LENGTH - 0.5, y + 0.03, wall + 0.3]);
        let here = books * (shelf + 1) / shelves - books * shelf / shelves;
        let pitch = (LENGTH - 1.0) / here as f64;
        for book in 0..here {
            let x = 0.5 + pitch * book as f64;
            let thick = pitch * noise.between(0.3, 0.95);
            let (high, deep) = (noise.between(0.12, 0.34), noise.between(0.1, 0.28));
            mesh.cuboid([x, y + 0.03, wall], [x + thick, y + 0.03 + high, wall + deep]);
        }
    }
}

/// Benches on both sides of the carpet; what a bench leaves of its share becomes spindles of its back.
fn benches(mesh: &mut Mesh, budget: usize) {
    let benches = (budget / 60).min(40);
    let spindles = (budget - 60 * benches) / 12;
    for bench in 0..benches {
        let x = 4.0 + 1.1 * (bench / 2) as f64;
        let z = [3.6, 7.2][bench % 2];
        mesh.cuboid([x, 0.42, z], [x + 0.4, 0.46, z + 1.2]);
        mesh.cuboid([x + 0.40, 0.85, z], [x + 0.44, 0.95, z + 1.2]);
        for side in [z, z + 1.15] {
            mesh.cuboid([x, 0.0, side], [x + 0.44, 0.42, side + 0.05]);
        }
        mesh.cuboid([x + 0.1, 0.1, z + 0.05], [x + 0.3, 0.14, z + 1.15]);
        let here = spindles * (bench + 1) / benches - spindles * bench / benches;
        for spindle in 0..here {
            let pitch = 1.2 / here as f64;
            let z = z + pitch * spindle as f64;
            mesh.cuboid([x + 0.41, 0.46, z], [x + 0.43, 0.85, z + 0.4 * pitch]);
        }
    }
}

/// Rings with beads and arms, hung from the ceiling by chains.
fn chandeliers(mesh: &mut Mesh, budget: usize) {
    const RADIUS: f64 = 1.2;
    let part = |percent: usize| budget / 3 * percent / 100;
    for x in [7.0, 15.0, 23.0] {
        let centre = [x, 5.5, 6.0];
        mesh.torus(grid(part(30), 8.0, (3, 3)), centre, ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]), RADIUS, 0.05);

        let links = (part(20) / 96).clamp(1, 30);
        let pitch = (HEIGHT - 0.6 - centre[1]) / links as f64;
        for link in 0..links {
            let at = add(centre, [0.0, pitch * (link as f64 + 0.5), 0.0]);
            let flat = if link % 2 == 0 { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] };
            mesh.torus(grid(part(20) / links, 2.5, (3, 3)), at, (flat, UP), 0.55 * pitch, 0.08 * pitch);
        }

        let beads = (part(40) / 64).clamp(1, 48);
        let n = ((part(40) / beads / 4) as f64).sqrt() as usize;
        for bead in 0..beads {
            let (c, s) = turn(bead, beads);
            mesh.sphere(n.max(2), add(centre, [RADIUS * c, -0.16, RADIUS * s]), 0.07);
        }

        let arms = (part(10) / 8).clamp(1, 12);
        let steps = (part(10) / (8 * arms)).max(1);
        for arm in 0..arms {
            let (c, s) = turn(arm, arms);
            mesh.tube(steps, 4, 0.012, UP, |k| {
                let out = RADIUS * k as f64 / steps as f64;
                add(centre, [out * c, 0.5 * (RADIUS - out) * (RADIUS - out), out * s])
            });
        }
    }
}

/// A knot of a rope with a rough skin, on a pedestal.
fn statue(mesh: &mut Mesh, budget: usize) {
    mesh.cuboid([28.2, 0.54, 5.4], [29.4, 1.4, 6.6]);
    let (steps, sides) = grid(budget.saturating_sub(12), 6.0, (9, 3));
    let centre = [28.8, 2.6, 6.0];
    mesh.surface(steps, sides, |i, j| {
        // A (2, 3) torus knot: twice round the axis while three times round the core.
        let part = (i % steps) as f64 / steps as f64;
        let ((c2, s2), (c3, s3)) = (angle(2.0 * part), angle(3.0 * part));
        let out = [c2, 0.0, s2];
        let rope = add(scaled(out, 0.6 + 0.25 * c3), scaled(UP, 0.6 * s3));
        // The skin turns in the plane of the core's normal and the direction across it.
        let normal = add(scaled(out, c3), scaled(UP, s3));
        let across = add(scaled([-s2, 0.0, c2], 0.6), add(scaled(out, -0.8 * s3), scaled(UP, 0.8 * c3)));
        let (c, s) = turn(j, sides);
        let rough = angle(40.0 * part + 3.0 * c).0 * angle(25.0 * part - 2.0 * s).1;
        let radius = 0.16 + 0.015 * rough;
        add(centre, add(rope, add(scaled(normal, radius * c), scaled(across, radius * s))))
    });
}

/// Rails as long as the hall on balusters, on both sides under the ceiling.
fn railings(mesh: &mut Mesh, budget: usize) {
    let balusters = (budget.saturating_sub(72) / 48).clamp(1, 200);
    let (sides, rings) = grid(budget.saturating_sub(72) / balusters, 0.7, (3, 1));
    for (side, z) in [1.2, 10.8].into_iter().enumerate() {
        for y in [7.3, 7.6, 8.3] {
            mesh.tube(1, 6, 0.025, UP, |k| [LENGTH * k as f64, y, z]);
        }
        for baluster in (0..balusters).filter(|baluster| baluster % 2 == side) {
            let x = LENGTH * (baluster as f64 + 0.5) / balusters as f64;
            mesh.surface(sides, rings, |i, j| {
                let height = j as f64 / rings as f64;
                let bulge = angle(2.0 * height).0;
                let (c, s) = turn(i, sides);
                let radius = 0.03 - 0.012 * bulge;
                [x + radius * c, 7.3 + height, z + radius * s]
            });
        }
    }
}

/// Slack cables from corner to corner.
fn cables(mesh: &mut Mesh, budget: usize) {
    let cables = (budget / 8).clamp(1, 10);
    let steps = (budget / (8 * cables)).max(1);
    for cable in 0..cables {
        let shift = 2.6 * cable as f64;
        let (near, far) = if cable % 2 == 0 { (0.1, 11.9) } else { (11.9, 0.1) };
        mesh.tube(steps, 4, 0.01, UP, |k| {
            let t = k as f64 / steps as f64;
            let sag = 1.2 * t * (1.0 - t);
            [0.5 + shift + 5.0 * t, 8.6 - 0.1 * cable as f64 - sag, near + (far - near) * t]
        });
    }
}

/// Blades of one triangle: mostly the pile of the carpet, some in bushes before the columns.
fn tufts(mesh: &mut Mesh) {
    let mut noise = Noise::new(1);
    let total = mesh.room();
    for blade in 0..total {
        if blade % 4 == 0 {
            let row = noise.unit() < 0.5;
            let z = if row { ROWS[0] - 1.2 } else { ROWS[1] + 1.2 };
            let k = (noise.unit() * COLUMNS_PER_ROW as f64) as usize;
            let (c, s) = angle(noise.unit());
            let radius = 0.45 * noise.unit().sqrt();
            let foot = [column_x(k) + radius * c, noise.between(0.2, 1.3), z + radius * s];
            mesh.blade(&mut noise, foot, 0.12, 0.03);
        } else {
            let foot = [noise.between(1.0, 27.0), 0.01, noise.between(5.0, 7.0)];
            mesh.blade(&mut noise, foot, 0.02, 0.006);
        }
    }
}
