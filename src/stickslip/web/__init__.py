"""The page of `stickslip web`: logs looked at, identified, compared and exported in a browser, on this machine alone.

A server (`stickslip.web.server`) shows files of `static` and answers requests (`stickslip.web.app`); whatever computes
runs in processes of its own (`stickslip.web.jobs`, `stickslip.web.worker`) through the public functions of the package.
The server itself computes nothing and keeps everything in a folder of projects (`stickslip.web.projects`).
"""
