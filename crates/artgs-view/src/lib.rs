//! The browser viewer: what the page shows ([`Page`]), a server for it on loopback ([`Server`]), and the same as one
//! file ([`export_page`]). [`Live`] is a run under way, which a server shows, too, and starts where it is given a [`Rerun`]. The page itself is built from `viewer/` and is part of this crate.

mod bundle;
mod camera;
mod cloud;
mod error;
mod guard;
mod http;
mod live;
mod page;
mod pending;
mod scene;
mod server;
mod single;
mod urdf;

pub use camera::{CameraView, Placement};
pub use cloud::Cloud;
pub use error::ViewError;
pub use live::Live;
pub use page::{Page, Source};
pub use scene::{Scene, SceneCamera, SceneCloud, SceneJoint, SceneLink, SceneMesh, SceneRerun};
pub use server::{DEFAULT_PORT, Rerun, Server};
pub use single::export_page;
