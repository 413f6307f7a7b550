// Parameters of the address of viser's page that set camera and resolution. docs/viser.md lists them.
export const PARAMETER = /^(initialCamera(Position|LookAt|Up|Fov|Near|Far)|fixedDpr)$/;
