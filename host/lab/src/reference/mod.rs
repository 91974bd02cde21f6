//! The lowest SAH costs that are known, by scene: what relative errors are measured against.
//!
//! They are committed beside this file and embedded. `cargo xtask bless` alone changes them, and only ever lowers one.

mod found;

pub use found::{Found, read};

use prbvh::bvh::SahModel;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::path::PathBuf;

/// Version of the file; grows when a key changes its meaning or goes away.
pub const SCHEMA: u32 = 1;

const EMBEDDED: &str = include_str!("best-costs.json");

/// The lowest cost known of a scene, one triangle per leaf.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceCost {
    /// Name of the scene, for people.
    pub scene: String,
    /// Hash of its triangles ([`prbvh::scene::Scene::hash`]).
    pub hash: String,
    /// Triangles.
    pub triangles: u32,
    /// Costs behind it.
    pub sah: SahModel,
    /// SAH cost in f64, unitless.
    pub cost: f64,
    /// What reached it.
    pub method: String,
    /// Commit of the program that measured it.
    pub commit: String,
}

/// All of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceCosts {
    /// [`SCHEMA`].
    pub schema: u32,
    /// By name of the scene.
    pub costs: Vec<ReferenceCost>,
}

/// What a cost did to the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Blessed {
    /// The scene was not there.
    New,
    /// It is lower than this one, which it replaced.
    Lowered(f64),
    /// It is not lower than this one, which stays.
    Kept(f64),
}

/// Why costs are refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// The file cannot be read.
    #[error("{path} cannot be read")]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The file is not what it should be.
    #[error("{name}, line {line}: {why}")]
    Parse {
        /// The file.
        name: String,
        /// Line, from 1 on.
        line: usize,
        /// What is wrong.
        why: String,
    },
    /// Another version.
    #[error("{name} has schema {has}, this program reads {SCHEMA}")]
    Schema {
        /// The file.
        name: String,
        /// Its version.
        has: u32,
    },
    /// A cost that no tree has.
    #[error("{cost} is no SAH cost ({scene}, {method}): {why}")]
    NoCost {
        /// The value; NaN for none.
        cost: f64,
        /// Scene.
        scene: String,
        /// What is said to have reached it.
        method: String,
        /// What it must be.
        why: String,
    },
}

impl ReferenceCosts {
    /// Those that this program was built with.
    ///
    /// # Errors
    /// If the embedded file is damaged, which a test rules out.
    pub fn embedded() -> Result<Self, ReferenceError> {
        Self::parse("best-costs.json", EMBEDDED)
    }

    /// Reads the file's text; `name` is for errors.
    ///
    /// # Errors
    /// If it is not such a file or has a cost that no tree can have.
    pub fn parse(name: &str, text: &str) -> Result<Self, ReferenceError> {
        let costs: Self = found::parse(name, text)?;
        if costs.schema != SCHEMA {
            return Err(ReferenceError::Schema { name: name.to_owned(), has: costs.schema });
        }
        costs.costs.iter().try_for_each(ReferenceCost::check)?;
        Ok(costs)
    }

    /// The file's text.
    ///
    /// # Errors
    /// If a number cannot be written as JSON.
    pub fn to_json(&self) -> serde_json::Result<String> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// The lowest cost known of the scene with this hash.
    #[must_use]
    pub fn get(&self, hash: &str, sah: &SahModel) -> Option<&ReferenceCost> {
        self.costs.iter().find(|known| known.hash == hash && known.sah == *sah)
    }

    /// Takes a cost up if it is lower than the one known.
    ///
    /// # Errors
    /// If no tree can have it; nothing is changed then.
    pub fn bless(&mut self, cost: ReferenceCost) -> Result<Blessed, ReferenceError> {
        cost.check()?;
        let Some(known) = self.costs.iter_mut().find(|known| known.hash == cost.hash && known.sah == cost.sah) else {
            self.costs.push(cost);
            let key = |cost: &ReferenceCost| (cost.scene.clone(), cost.hash.clone());
            self.costs.sort_by_key(key);
            return Ok(Blessed::New);
        };
        let before = known.cost;
        if cost.cost < before {
            *known = cost;
            return Ok(Blessed::Lowered(before));
        }
        Ok(Blessed::Kept(before))
    }
}

impl ReferenceCost {
    /// `cost / reference - 1`.
    #[must_use]
    pub fn error_of(&self, cost: f64) -> f64 {
        cost / self.cost - 1.0
    }

    /// Every ray that meets the root pays for it, so a tree of several leaves costs at least a step of the traversal, and a lone leaf
    /// its test.
    fn check(&self) -> Result<(), ReferenceError> {
        let least = if self.triangles > 1 { self.sah.c_traversal } else { self.sah.c_intersect };
        if self.cost.is_finite() && self.cost > 0.0 && self.cost.partial_cmp(&least) != Some(Ordering::Less) {
            return Ok(());
        }
        Err(ReferenceError::NoCost {
            cost: self.cost,
            scene: self.scene.clone(),
            method: self.method.clone(),
            why: format!("it must be finite and at least {least}, the cost of its root"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn cost(hash: &str, cost: f64) -> ReferenceCost {
        ReferenceCost {
            scene: "hall".to_owned(),
            hash: hash.to_owned(),
            triangles: 9,
            sah: SahModel::default(),
            cost,
            method: "prbvh µ=1".to_owned(),
            commit: "abc".to_owned(),
        }
    }

    #[test]
    fn the_embedded_file_is_whole_and_as_bless_writes_it() {
        let costs = ReferenceCosts::embedded().unwrap();
        assert_eq!(costs.to_json().unwrap(), EMBEDDED);
        for (k, known) in costs.costs.iter().enumerate() {
            assert!(known.hash.len() == 32 && known.hash.bytes().all(|digit| digit.is_ascii_hexdigit()), "{known:?}");
            assert!(
                costs.costs[..k].iter().all(|other| other.hash != known.hash || other.sah != known.sah),
                "{known:?}"
            );
        }
    }

    #[test]
    fn costs_are_lowered_and_never_raised() {
        let mut costs = ReferenceCosts { schema: SCHEMA, costs: Vec::new() };
        assert_eq!(costs.bless(cost("a", 50.0)).unwrap(), Blessed::New);
        assert_eq!(costs.bless(cost("b", 70.0)).unwrap(), Blessed::New);
        assert_eq!(costs.bless(cost("a", 49.0)).unwrap(), Blessed::Lowered(50.0));
        for higher in [49.0, 49.0f64.next_up(), 1e30] {
            let before = costs.clone();
            assert_eq!(costs.bless(cost("a", higher)).unwrap(), Blessed::Kept(49.0));
            assert_eq!(costs, before);
        }
        let other = SahModel { c_traversal: 1.0, c_intersect: 1.0 };
        assert_eq!(costs.bless(ReferenceCost { sah: other, ..cost("a", 20.0) }).unwrap(), Blessed::New);
        assert_eq!(costs.get("a", &SahModel::default()).unwrap().cost, 49.0);
        assert_eq!(costs.get("a", &other).unwrap().error_of(25.0), 0.25);
        assert_eq!(costs.get("c", &other), None);
    }

    #[test]
    fn what_is_no_cost_is_refused_and_changes_nothing() {
        let mut costs = ReferenceCosts { schema: SCHEMA, costs: vec![cost("a", 50.0)] };
        let before = costs.clone();
        for bad in [f64::NAN, 0.0, -1.0, 2.999, f64::INFINITY, f64::NEG_INFINITY] {
            let error = costs.bless(cost("a", bad)).unwrap_err().to_string();
            assert!(error.contains("hall, prbvh µ=1") && error.contains("at least 3"), "{error}");
            assert!(costs.bless(cost("new", bad)).is_err());
        }
        assert_eq!(costs, before);
        assert!(costs.bless(ReferenceCost { triangles: 1, ..cost("one", 2.0) }).is_ok());
    }

    #[test]
    fn a_damaged_file_is_named_with_its_line() {
        let good = ReferenceCosts { schema: SCHEMA, costs: vec![cost("a", 50.0)] }.to_json().unwrap();
        assert_eq!(ReferenceCosts::parse("f", &good).unwrap().costs[0], cost("a", 50.0));
        for (bad, part) in [
            (good.replace("\"schema\": 1", "\"schema\": 2"), "f has schema 2, this program reads 1"),
            (good.replace("50.0", "0.0"), "0 is no SAH cost (hall"),
            (good.replace("50.0", "null"), "f, line 12: invalid type: null"),
            (good.replace("\"hash\"", "\"hush\""), "missing field `hash`"),
            (String::new(), "f, line 1: EOF"),
        ] {
            let error = ReferenceCosts::parse("f", &bad).unwrap_err().to_string();
            assert!(error.contains(part), "{part}: {error}");
        }
    }
}
