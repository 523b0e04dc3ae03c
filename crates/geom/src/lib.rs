//! Points, planes, polygons and charts: the geometry that knows no scene.
//!
//! Exact predicates come from `robust`; the constrained Delaunay triangulation
//! comes from `spade` and is reached only through [`cdt`].

pub mod cdt;
mod chart;
mod coarse;
mod control;
mod convex;
mod measure;
mod polygon;
mod settle;
mod stop;

pub use chart::Chart;
pub use coarse::{coarse_order, exceeds};
pub use control::{Control, Phase};
pub use convex::convex_pieces;
pub use glam::{DVec2, DVec3, dvec2, dvec3};
pub use measure::{
    bounding_box, distance_to_segment, distance_to_segment_in_space, nearest_on_segment,
};
pub use polygon::{
    is_left_of, newell_normal, point_in_polygon, polygon_area, segments_cross, signed_area,
};
pub use settle::{Plane, settled};
pub use stop::Stop;
