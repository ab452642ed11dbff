// A metric's name ends in its unit: velocity_rms_rad_s.

const UNITS = [["_rad_s", "rad/s"], ["_per_s", "1/s"], ["_rad", "rad"], ["_Nm", "N·m"], ["_J", "J"], ["_s", "s"]];
const parted = (metric) => UNITS.find(([end]) => metric.endsWith(end)) ?? ["", ""];

export const unitOf = (metric) => parted(metric)[1];

export const metricName = (metric) => metric.slice(0, metric.length - parted(metric)[0].length).replaceAll("_", " ").replace("50Hz", "50 Hz");
