//! `armcal-lab edges` and `paths`: the geometry of planning without the rest of the loop.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;

use armcal::cli::Exit;
use armcal::cli::{note, say};
use armcal::output;
use armcal_belief::plan::ClearanceModel;
use armcal_core::robot::{load, load_vehicle};
use armcal_core::routine::{self, Scene};
use armcal_lab::{
    Belief, EdgeStudy, PathQueries, PathSite, PathStudy, edge_study, edges_csv, edges_json, mean_time_under_s,
    path_study, paths_csv, problem_json, queries_json, random_edges,
};

/// Margin that the studies require, m.
const MARGIN_M: f64 = 0.05;
/// Number of edges that are written for other checkers.
const WRITTEN_EDGES: usize = 2000;
/// Number of edges that are timed under the joint error bounds.
const TIMED_EDGES: usize = 2000;

#[derive(Debug, Args)]
pub(super) struct EdgesArgs {
    /// Folder for edges.csv and edges.json
    #[arg(long, value_name = "DIR", default_value = "recordings/study-edges")]
    out: PathBuf,
    /// Random edges of each arm
    #[arg(
        long, value_name = "N", default_value_t = 20_000,
        value_parser = clap::value_parser!(u32).range(1..=10_000_000)
    )]
    n: u32,
    /// Robot folders
    #[arg(long, value_name = "DIR", default_values = ["robots/titan4", "robots/kraft-predator"], num_args = 1..)]
    robot: Vec<PathBuf>,
    /// What they are mounted on: a vehicle of 30 parts
    #[arg(long, value_name = "FILE", default_value = "robots/vehicles/work-class-front.toml")]
    vehicle: PathBuf,
    /// Seed of the edges
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

#[derive(Debug, Args)]
pub(super) struct PathsArgs {
    /// Folder for paths.csv and a JSON file of each site's scene and queries, for other planners
    #[arg(long, value_name = "DIR", default_value = "recordings/study-paths")]
    out: PathBuf,
    /// Random queries at each site and under each belief
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    n: u32,
    /// Routines whose scenes and vehicles are the sites
    #[arg(
        long, value_name = "FILE", num_args = 1..,
        default_values = ["routines/kraft-open-frame.toml", "routines/tight-basket.toml", "routines/under-ice.toml"]
    )]
    routine: Vec<PathBuf>,
    /// Robot folder of the arm on all of them
    #[arg(long, value_name = "DIR", default_value = "robots/titan4")]
    robot: PathBuf,
    /// Seed of queries and planner
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

pub(super) fn edges(args: &EdgesArgs) -> Result<Exit> {
    let clock = clock();
    let mut studies = Vec::new();
    let mut written = Vec::new();
    let mut timed = String::new();
    for folder in &args.robot {
        let vehicle = load_vehicle(&args.vehicle)?;
        let robot = load(folder)?.mounted_on(&vehicle)?;
        let site = PathSite { name: vehicle.name.clone(), robot, vehicle, scene: Scene::default() };
        let clearance = ClearanceModel::new(&site.robot, &site.vehicle, &site.scene);
        let edges = random_edges(&site.robot, args.n as usize, args.seed);
        let start_s = clock();
        let study = edge_study(&site.robot, &clearance, &edges, MARGIN_M, &clock);
        note(format_args!("{}: {} edges certified and scanned in {:.0} s", study.arm, edges.len(), clock() - start_s));
        let n_timed = edges.len().min(TIMED_EDGES);
        for belief in [Belief::Calibrated, Belief::Datasheet] {
            let (_, bounds) = site.believed(belief);
            let mean_us = 1e6 * mean_time_under_s(&clearance, &edges[..n_timed], &bounds, MARGIN_M, &clock);
            timed += &format!("{}, {} bounds: {mean_us:.0} us an edge, mean of {n_timed}\n", study.arm, belief.name());
        }
        let n_written = edges.len().min(WRITTEN_EDGES);
        let rows = edges_json(&edges[..n_written], &study);
        written.push((format!("edges-{}.json", study.arm), problem_json(&site, &rows, MARGIN_M).to_string()));
        studies.push(study);
    }
    written.push(("edges.csv".to_owned(), edges_csv(&studies)));
    write(&args.out, &written)?;
    let rows: Vec<String> = studies.iter().map(EdgeStudy::summary).collect();
    say(&format!("{}\n{}\n{timed}written      {}", EdgeStudy::heading(), rows.join("\n"), args.out.display()))?;
    Ok(Exit::Ok)
}

pub(super) fn paths(args: &PathsArgs) -> Result<Exit> {
    let clock = clock();
    let mut studies = Vec::new();
    let mut written = Vec::new();
    for file in &args.routine {
        let routine = routine::load(file)?;
        let vehicle = load_vehicle(&routine.vehicle_file)?;
        let robot = load(&args.robot)?.mounted_on(&vehicle)?;
        let site = PathSite { name: vehicle.name.clone(), robot, vehicle, scene: routine.scene };
        for belief in Belief::ALL {
            note(format_args!("{}, {} ...", site.name, belief.name()));
            let queries = PathQueries { n: args.n as usize, margin_m: MARGIN_M, seed: args.seed };
            let study = path_study(&site, belief, queries, &clock);
            if belief == Belief::Alone {
                let problem = problem_json(&site, &queries_json(&study), MARGIN_M);
                written.push((format!("paths-{}.json", site.name), problem.to_string()));
            }
            studies.push(study);
        }
    }
    written.push(("paths.csv".to_owned(), paths_csv(&studies)));
    write(&args.out, &written)?;
    let rows: Vec<String> = studies.iter().map(PathStudy::summary).collect();
    say(&format!("{}\n{}\nwritten      {}", PathStudy::heading(), rows.join("\n"), args.out.display()))?;
    Ok(Exit::Ok)
}

fn clock() -> impl Fn() -> f64 {
    let start = Instant::now();
    move || start.elapsed().as_secs_f64()
}

fn write(folder: &Path, files: &[(String, String)]) -> Result<()> {
    output::make_folder(folder)?;
    for (name, text) in files {
        let path = folder.join(name);
        fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))?;
    }
    Ok(())
}
