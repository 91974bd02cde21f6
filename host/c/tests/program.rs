//! Programs in C, compiled and run: the example with either library, and one that gives wrong arguments.

#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// The library, however it is linked.
#[derive(Clone, Copy)]
enum Linked {
    Static,
    Dynamic,
}

/// Where cargo put the libraries that it built for this test.
fn libraries() -> PathBuf {
    // Naming the crate makes cargo build it before the test, in all of its forms.
    let _ = prbvh_c::prbvh_version;
    let test = std::env::current_exe().unwrap();
    test.parent().unwrap().to_owned()
}

/// Compiles a program against the header and the library, and runs it. Returns whether it ended well, and what it printed.
fn run(source: &Path, linked: Linked) -> (bool, String) {
    let folder = TempDir::new().unwrap();
    let program = folder.path().join("program");
    let (libraries, package) = (libraries(), Path::new(env!("CARGO_MANIFEST_DIR")));
    let mut cc = Command::new("cc");
    cc.args(["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-I"]).arg(package.join("include"));
    cc.arg(source).arg("-o").arg(&program);
    match linked {
        Linked::Static => cc.arg(libraries.join("libprbvh_c.a")),
        Linked::Dynamic => {
            cc.arg("-L").arg(&libraries).arg("-lprbvh_c").arg(format!("-Wl,-rpath,{}", libraries.display()))
        }
    };
    cc.args(["-lpthread", "-ldl", "-lm"]);
    let compiled = cc.output().expect("a C compiler named cc (Debian and Ubuntu: apt-get install build-essential)");
    assert!(compiled.status.success(), "{cc:?}: {}", String::from_utf8_lossy(&compiled.stderr));
    let ran = Command::new(&program).output().unwrap();
    let printed = [ran.stdout, ran.stderr].concat();
    (ran.status.success(), String::from_utf8_lossy(&printed).into_owned())
}

fn text(name: &str, source: &str) -> (TempDir, PathBuf) {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, source).unwrap();
    (folder, path)
}

#[test]
fn the_example_runs_with_either_library() {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/optimize.c");
    for linked in [Linked::Static, Linked::Dynamic] {
        let (well, printed) = run(&example, linked);
        assert!(well && printed.contains("iteration 1: cost ") && printed.contains("over 1600 boxes"), "{printed}");
    }
}

#[test]
fn what_the_caller_does_wrong_has_a_status_and_a_text() {
    let (_folder, source) = text("wrong.c", WRONG);
    let (well, printed) = run(&source, Linked::Dynamic);
    assert!(well, "{printed}");
    let lines: Vec<&str> = printed.lines().collect();
    let wanted = [
        "1 vertices is NULL",
        "2 there are no triangles",
        "2 triangle 1: vertex 9 is not among the 4 vertices",
        "1 options.size is 7, but sizeof(PrbvhOptions) is ",
        "1 options has fields set that this version of prbvh does not know",
        "0 ",
        "1 options.device is 9, but the last PrbvhDevice is 3",
        "1 options.max_seconds is -1, but must be at least 0",
        "1 options.initial_name: \"random\" is none of lbvh, ploc",
        "1 options.initial_name: kmeans.k is 65, but must be 2 to 64",
        "1 options.initial_name is no UTF-8",
        "1 options.optimizer is 4, but the last PrbvhOptimizer is 3",
        "0 ",
        "1 result.size is 0, but sizeof(PrbvhResult) is ",
        "2 box 0: the smallest y is 2, above the largest, 1",
        "1 nodes is not aligned to 4 bytes",
        "2 ",
        "3 ",
    ];
    assert_eq!(lines.len(), wanted.len(), "{printed}");
    for (line, wanted) in lines.iter().zip(wanted) {
        assert!(line.starts_with(wanted), "`{line}`, not `{wanted}`");
    }
    assert!(lines[16].contains("NaN"), "{}", lines[16]);
}

#[test]
fn progress_ends_a_run_with_the_best_tree_so_far() {
    let (_folder, source) = text("cancel.c", CANCEL);
    let (well, printed) = run(&source, Linked::Dynamic);
    assert!(well, "{printed}");
}

/// Prints status and text of one mistake after another.
const WRONG: &str = r#"
#include "prbvh.h"
#include <math.h>
#include <stdio.h>
#include <string.h>
static void say(PrbvhStatus status) { printf("%d %s\n", (int)status, prbvh_last_error()); }
int main(void) {
    float vertices[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 1};
    uint32_t indices[6] = {0, 1, 2, 1, 2, 3}, wrong[6] = {0, 1, 2, 1, 2, 9}, order[2];
    PrbvhNode nodes[4];
    PrbvhOptions options = {0};
    PrbvhResult result = {0};
    PrbvhBox box = {{0, 2, 0}, {1, 1, 1}};
    struct { PrbvhOptions known; size_t later; } newer;
    memset(&newer, 0, sizeof newer);
    say(prbvh_optimize_triangles(NULL, 4, indices, 2, NULL, nodes, order, NULL));
    say(prbvh_optimize_triangles(vertices, 4, indices, 0, NULL, nodes, order, NULL));
    say(prbvh_optimize_triangles(vertices, 4, wrong, 2, NULL, nodes, order, NULL));
    options.size = 7;
    say(prbvh_optimize_triangles(vertices, 4, indices, 2, &options, nodes, order, NULL));
    newer.known.size = sizeof newer;
    newer.known.device = PRBVH_DEVICE_CPU;
    newer.later = 1;
    say(prbvh_optimize_triangles(vertices, 4, indices, 2, &newer.known, nodes, order, NULL));
    newer.later = 0;
    say(prbvh_optimize_triangles(vertices, 4, indices, 2, &newer.known, nodes, order, NULL));
    options.size = sizeof options;
    options.device = 9;
    say(prbvh_optimize_triangles(vertices, 4, indices, 2, &options, nodes, order, NULL));
    options.device = PRBVH_DEVICE_CPU;
    options.max_seconds = -1;
    say(prbvh_optimize_triangles(vertices, 4, indices, 2, &options, nodes, order, NULL));
    options.max_seconds = 0;
    options.initial_name = "random";
    say(prbvh_optimize_triangles(vertices, 4, indices, 2, &options, nodes, order, NULL));
    options.initial_name = "kmeans:k=65";
    say(prbvh_optimize_triangles(vertices, 4, indices, 2, &options, nodes, order, NULL));
    options.initial_name = "\xff";
    say(prbvh_optimize_triangles(vertices, 4, indices, 2, &options, nodes, order, NULL));
    options.initial_name = "kmeans:q1";
    options.optimizer = 4;
    say(prbvh_optimize_triangles(vertices, 4, indices, 2, &options, nodes, order, NULL));
    options.optimizer = PRBVH_OPTIMIZER_ROTATIONS;
    say(prbvh_optimize_triangles(vertices, 4, indices, 2, &options, nodes, order, NULL));
    options.optimizer = PRBVH_OPTIMIZER_PRBVH;
    options.initial_name = NULL;
    say(prbvh_optimize_triangles(vertices, 4, indices, 2, &options, nodes, order, &result));
    say(prbvh_optimize_boxes(&box, 1, &options, nodes, order, NULL));
    say(prbvh_optimize_triangles(vertices, 4, indices, 2, &options, (PrbvhNode *)((char *)nodes + 1), order, NULL));
    vertices[4] = NAN;
    say(prbvh_optimize_triangles(vertices, 4, NULL, 1, &options, nodes, order, NULL));
    vertices[4] = 0;
    options.device = PRBVH_DEVICE_VULKAN_INDEX;
    options.device_index = 1000;
    say(prbvh_optimize_triangles(vertices, 4, NULL, 1, &options, nodes, order, NULL));
    return strcmp(prbvh_error_text(1), "invalid argument") != 0;
}
"#;

/// Ends a run at the second iteration; some may be made together with it.
const CANCEL: &str = r#"
#include "prbvh.h"
#include <stdio.h>
static PrbvhBox boxes[3000];
static PrbvhNode nodes[5999];
static uint32_t order[3000];
static int told(void *user, const PrbvhProgress *progress) {
    ++*(int *)user;
    return progress->iteration >= 2;
}
int main(void) {
    unsigned state = 1;
    int calls = 0;
    PrbvhOptions options = {0};
    PrbvhResult result = {0};
    for (int k = 0; k < 3000; k++)
        for (int axis = 0; axis < 3; axis++) {
            state = state * 1664525u + 1013904223u;
            boxes[k].min[axis] = (float)(state >> 8) / 16777216.0f;
            boxes[k].max[axis] = boxes[k].min[axis] + 0.01f;
        }
    options.size = sizeof options;
    options.device = PRBVH_DEVICE_CPU;
    options.max_leaf = 4;
    options.progress = told;
    options.user = &calls;
    result.size = sizeof result;
    PrbvhStatus status = prbvh_optimize_boxes(boxes, 3000, &options, nodes, order, &result);
    printf("%d: %d calls, stop %u, %u iterations, %zu nodes, cost %f of %f\n", (int)status, calls, result.stop,
           result.iterations, result.node_count, result.cost, result.initial_cost);
    return !(status == PRBVH_STATUS_OK && result.stop == PRBVH_STOP_CANCELLED && calls == 3 && result.iterations >= 2 &&
             result.node_count < 5999 && result.cost < result.initial_cost);
}
"#;
