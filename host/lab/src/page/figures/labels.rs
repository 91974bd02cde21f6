//! Names beside what they name, without one over another.

/// Pixels between a point and its name.
const GAP: f64 = 12.0;
/// Farther than this a line leads to the name, and always to one above or below its point.
const LEADER: f64 = 22.0;
/// Side of a cell in which ink is counted, pixels.
const CELL: f64 = 6.0;

/// A rectangle in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) x0: f64,
    pub(super) y0: f64,
    pub(super) x1: f64,
    pub(super) y1: f64,
}

impl Rect {
    fn meets(&self, other: &Self) -> bool {
        self.x0 < other.x1 && other.x0 < self.x1 && self.y0 < other.y1 && other.y0 < self.y1
    }

    fn holds(&self, other: &Self) -> bool {
        self.x0 <= other.x0 && self.y0 <= other.y0 && other.x1 <= self.x1 && other.y1 <= self.y1
    }

    /// Its point next to (x, y).
    fn nearest(&self, x: f64, y: f64) -> (f64, f64) {
        (x.clamp(self.x0, self.x1), y.clamp(self.y0, self.y1))
    }
}

/// Where a name went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    /// Its rectangle.
    pub(super) rect: Rect,
    /// End of the line that leads to it, unless it stands right beside its point.
    pub(super) leader: Option<(f64, f64)>,
}

/// A page with ink on it, on which names find free places.
#[derive(Debug)]
pub(super) struct Labels {
    bounds: Rect,
    columns: usize,
    ink: Vec<bool>,
    taken: Vec<Rect>,
    leaders: Vec<[(f64, f64); 2]>,
}

impl Labels {
    pub(super) fn new(bounds: Rect) -> Self {
        let columns = ((bounds.x1 - bounds.x0) / CELL).ceil().max(1.0) as usize;
        let rows = ((bounds.y1 - bounds.y0) / CELL).ceil().max(1.0) as usize;
        Self { bounds, columns, ink: vec![false; columns * rows], taken: Vec::new(), leaders: Vec::new() }
    }

    /// Marks a line as drawn.
    pub(super) fn line(&mut self, from: (f64, f64), to: (f64, f64)) {
        let steps = ((to.0 - from.0).abs().max((to.1 - from.1).abs()) / (0.5 * CELL)).ceil().clamp(1.0, 1e5);
        for k in 0..=steps as usize {
            let t = k as f64 / steps;
            if let Some(cell) = self.cell(from.0 + t * (to.0 - from.0), from.1 + t * (to.1 - from.1)) {
                self.ink[cell] = true;
            }
        }
    }

    /// Keeps names off a mark.
    pub(super) fn mark(&mut self, x: f64, y: f64, r: f64) {
        self.taken.push(Rect { x0: x - r, y0: y - r, x1: x + r, y1: y + r });
    }

    /// A place for a name of this size, near the point: off other names and marks always, off drawn lines as far as can be. None if there
    /// is no room at all.
    pub(super) fn place(&mut self, (x, y): (f64, f64), width: f64, height: f64) -> Option<Placed> {
        const DIRECTIONS: usize = 24;
        const RADII: i32 = 19;
        let mut best: Option<(f64, Placed)> = None;
        for step in 0..RADII {
            let radius = GAP * 1.26f64.powi(step);
            for k in 0..DIRECTIONS {
                // To the right first, then in turn above and below: ties go to the first.
                let turn = (k.div_ceil(2) as f64) * if k % 2 == 0 { 1.0 } else { -1.0 };
                let (dy, dx) = (turn * std::f64::consts::TAU / DIRECTIONS as f64).sin_cos();
                // The near edge of the name, not its middle, is at the radius.
                let (cx, cy) = (x + dx * (radius + 0.5 * width), y + dy * (radius + 0.5 * height));
                let rect =
                    Rect { x0: cx - 0.5 * width, y0: cy - 0.5 * height, x1: cx + 0.5 * width, y1: cy + 0.5 * height };
                if !self.bounds.holds(&rect) || self.taken.iter().any(|taken| taken.meets(&rect)) {
                    continue;
                }
                let end = rect.nearest(x, y);
                let distance = (end.0 - x).hypot(end.1 - y);
                let leader = (distance > LEADER || end.1 != y).then_some(end);
                let leads = [(x, y), end];
                let crossings = if leader.is_some() { self.crossings(&leads) } else { 0 };
                let over = self.leaders.iter().filter(|line| meets_line(&rect, line)).count();
                let cost = radius.max(distance) + 14.0 * self.inked(&rect) + 40.0 * crossings as f64 + 60.0 * over as f64
                    // Names are looked for on the right.
                    + 6.0 * (1.0 - dx);
                if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                    best = Some((cost, Placed { rect, leader }));
                }
            }
            if best.as_ref().is_some_and(|(cost, _)| *cost < radius) {
                break;
            }
        }
        let (_, placed) = best?;
        self.taken.push(placed.rect);
        if let Some(end) = placed.leader {
            self.leaders.push([(x, y), end]);
        }
        Some(placed)
    }

    fn cell(&self, x: f64, y: f64) -> Option<usize> {
        let (column, row) = ((x - self.bounds.x0) / CELL, (y - self.bounds.y0) / CELL);
        if !(column >= 0.0 && row >= 0.0 && column < self.columns as f64) {
            return None;
        }
        let cell = row as usize * self.columns + column as usize;
        (cell < self.ink.len()).then_some(cell)
    }

    /// Cells with ink under the rectangle, per column of it, about.
    fn inked(&self, rect: &Rect) -> f64 {
        let (mut cells, mut y) = (0, rect.y0);
        while y < rect.y1 {
            let mut x = rect.x0;
            while x < rect.x1 {
                cells += usize::from(self.cell(x, y).is_some_and(|cell| self.ink[cell]));
                x += CELL;
            }
            y += CELL;
        }
        (cells as f64).min(12.0)
    }

    /// Names and leaders that a leader would cross.
    fn crossings(&self, line: &[(f64, f64); 2]) -> usize {
        let names = self.taken.iter().filter(|rect| rect.nearest(line[0].0, line[0].1) != line[0]);
        names.filter(|rect| meets_line(rect, line)).count()
            + self.leaders.iter().filter(|other| lines_cross(line, other)).count()
    }
}

fn meets_line(rect: &Rect, [from, to]: &[(f64, f64); 2]) -> bool {
    let steps = ((to.0 - from.0).hypot(to.1 - from.1) / CELL).ceil().max(1.0);
    (0..=steps as usize).any(|k| {
        let t = k as f64 / steps;
        let (x, y) = (from.0 + t * (to.0 - from.0), from.1 + t * (to.1 - from.1));
        x > rect.x0 && x < rect.x1 && y > rect.y0 && y < rect.y1
    })
}

fn lines_cross([a, b]: &[(f64, f64); 2], [c, d]: &[(f64, f64); 2]) -> bool {
    let side = |p: &(f64, f64), q: &(f64, f64), r: &(f64, f64)| (q.0 - p.0) * (r.1 - p.1) - (q.1 - p.1) * (r.0 - p.0);
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PAGE: Rect = Rect { x0: 0.0, y0: 0.0, x1: 1000.0, y1: 600.0 };

    #[test]
    fn a_lone_name_stands_to_the_right() {
        let placed = Labels::new(PAGE).place((500.0, 300.0), 100.0, 20.0).unwrap();
        assert_eq!(placed.rect, Rect { x0: 512.0, y0: 290.0, x1: 612.0, y1: 310.0 });
        assert_eq!(placed.leader, None);
    }

    #[test]
    fn ink_is_gone_round() {
        let mut labels = Labels::new(PAGE);
        labels.line((500.0, 300.0), (1000.0, 300.0));
        let rect = labels.place((500.0, 300.0), 100.0, 20.0).unwrap().rect;
        assert!(rect.y1 < 300.0 || rect.y0 > 306.0 || rect.x1 < 500.0, "{rect:?}");
    }

    #[test]
    fn no_room_is_said() {
        let mut labels = Labels::new(Rect { x0: 0.0, y0: 0.0, x1: 50.0, y1: 600.0 });
        assert_eq!(labels.place((20.0, 300.0), 100.0, 20.0), None);
    }

    proptest! {
        /// Forty names at points drawn by chance, many of them in one spot.
        #[test]
        fn names_never_overlap(points in proptest::collection::vec((0.0..999.0f64, 0.0..599.0f64), 20), at in 0..19usize) {
            let mut labels = Labels::new(PAGE);
            let mut names: Vec<Rect> = Vec::new();
            let again = std::iter::repeat_n(points[at], 20);
            for point in points.iter().copied().chain(again) {
                labels.line(point, points[0]);
                if let Some(placed) = labels.place(point, 150.0, 20.0) {
                    prop_assert!(PAGE.holds(&placed.rect));
                    prop_assert!(names.iter().all(|name| !name.meets(&placed.rect)));
                    names.push(placed.rect);
                }
            }
            // There is room for all; the search may miss some in a corner.
            prop_assert!(names.len() >= 30, "{}", names.len());
        }
    }
}
